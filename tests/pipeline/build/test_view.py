"""The view of a scene: what is declared can be read, everything else raises and is named."""

from typing import Any, ClassVar

import pytest

from pipeline.build.view import SceneView, Undeclared, value_at
from pipeline.tables import Table, key


class Inner(Table):
    """A table."""

    factor: ClassVar[int] = 3

    a: int = key("a number", 1)
    b: int = key("another", 2)

    def product(self) -> int:
        """Of a and the factor of the class."""
        return self.a * self.factor

    @classmethod
    def named(cls) -> str:
        """The class."""
        return cls.__name__


class Outer(Table):
    """A scene."""

    inner: Inner = Inner()
    others: tuple[Inner, ...] = (Inner(a=5), Inner(a=6))
    nothing: Inner | None = None
    seed: int = key("a seed", 7)

    @property
    def doubled(self) -> int:
        """Of the seed."""
        return 2 * self.seed


def seen(*reads: str) -> Any:
    return SceneView(Outer(), reads, "thing")


def test_a_declared_key_gives_its_value() -> None:
    assert seen("seed").seed == 7
    assert seen("inner.a").inner.a == 1
    assert seen("inner").inner == Inner()
    assert seen("others").others[1].a == 6


@pytest.mark.parametrize(("reads", "read"), [
    (("inner",), lambda s: s.seed), (("inner.a",), lambda s: s.inner.b), ((), lambda s: s.inner),
    (("inner.ab",), lambda s: s.inner.a), (("seed",), lambda s: s.doubled), (("others[0].a",), lambda s: s.seed)])
def test_an_undeclared_key_raises_and_is_named_with_its_artifact(reads: tuple[str, ...], read: Any) -> None:
    with pytest.raises(Undeclared, match=r"^thing reads [a-z.]+, which it does not declare$"):
        read(seen(*reads))


def test_it_is_no_missing_attribute_that_a_default_would_hide() -> None:
    with pytest.raises(Undeclared):
        getattr(seen("seed"), "inner", None)


def test_a_property_is_a_key_like_any_other() -> None:
    assert seen("doubled").doubled == 14


def test_a_table_that_is_not_there_is_none() -> None:
    assert seen("nothing.a").nothing is None


def test_methods_can_be_called_only_of_a_table_that_is_declared_as_a_whole() -> None:
    """Of another its code would not count."""
    assert seen("inner").inner.product() == 3
    assert seen("inner").inner.named() == "Inner"
    for name in ("product", "named"):
        with pytest.raises(Undeclared, match=rf"thing reads inner\.{name}"):
            getattr(seen("inner.a", "inner.factor").inner, name)
    assert seen("inner.factor").inner.factor == 3


def test_a_dotted_key_is_followed_in_a_scene_and_in_its_view() -> None:
    assert value_at(Outer(), "others[1].a") == 6
    assert value_at(Outer(), "inner.nothing") is None
    assert value_at(seen("others[1]"), "others[1].a") == 6
    with pytest.raises(Undeclared, match=r"thing reads others\[0\]\.a"):
        value_at(seen("others[1]"), "others[0].a")
