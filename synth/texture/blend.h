// What 16 places show of the patches that reach them: `covered`, where any does, and `colour` [CHANNELS], the mean plus
// the gain times the mean weighted difference, as `draw_reference` in patches.py says. It stands inside a kernel that
// has FROM_CENTRE and HIDE, first and end, and the arguments of `draw`.

    float16 nearest = (float16)(FARTHEST);
    for (int k = first; k < end; k++) {
        FROM_CENTRE;
        float16 e = remoteness(s, m, p, p[BIAS]);
        HIDE(e, e < nearest);
        nearest = fmin(nearest, e);
    }
    float16 sum = (float16)(0.0f), squares = sum, power = sum, colour[CHANNELS];
    for (int c = 0; c < CHANNELS; c++) colour[c] = sum;
    for (int k = first; k < end; k++) {
        FROM_CENTRE;
        float16 e = remoteness(s, m, p, p[BIAS]);
        if (!any(e < nearest + 4.0f)) continue;
        HIDE(e, e < nearest + 4.0f);
        const float16 w = weight(e - nearest);
        float16 px, py, value[CHANNELS];
        place(s, m, p, turn, last, &px, &py);
        READ_COLOUR(CHANNELS)(sample, enlarged.x, enlarged.y, px, py, value);
        sum += w;
        squares += w * w;
        for (int c = 0; c < CHANNELS; c++) {
            const float16 beyond = value[c] - tones[c];
            colour[c] += w * beyond;
            power += w * (beyond * beyond);
        }
    }
    const int16 covered = sum > 0.0f;
    sum = select((float16)(1.0f), sum, covered);
    squares = select((float16)(1.0f), squares, covered);
    // how far the patches differ here, over what unlike ones would
    float16 unlike = power / sum;
    for (int c = 0; c < CHANNELS; c++) {
        colour[c] /= sum;
        unlike -= colour[c] * colour[c];
    }
    unlike = fmin(fmax(unlike * tones[3 * CHANNELS] / fmax(1.0f - squares / (sum * sum), 1e-6f), 0.0f), 1.0f);
    const float16 gain = 1.0f + blend * unlike * (sum / sqrt(squares) - 1.0f);
    for (int c = 0; c < CHANNELS; c++)
        colour[c] = fmin(fmax(tones[c] + gain * colour[c], tones[CHANNELS + c]), tones[2 * CHANNELS + c]);
