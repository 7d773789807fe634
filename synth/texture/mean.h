// Of the patches that reach 16 places the weighted mean luminance: `total` over `sum`. It stands inside a kernel that has
// FROM_THIS and HIDE_PLACES, first and end, and the arguments of `rectify`.

    float16 nearest = (float16)(FARTHEST);
    for (int k = first; k < end; k++) {
        FROM_THIS;
        HIDE_PLACES(e < nearest);
        nearest = fmin(nearest, e);
    }
    float16 sum = (float16)(0.0f), total = sum;
    for (int k = first; k < end; k++) {
        FROM_THIS;
        if (!any(e < nearest + 4.0f)) continue;
        HIDE_PLACES(e < nearest + 4.0f);
        const float16 w = weight(e - nearest);
        float16 px, py, value;
        place(s, m, p, turn, last, &px, &py);
        read1(sample, enlarged.x, enlarged.y, px, py, &value);
        sum += w;
        total += w * value;
    }
