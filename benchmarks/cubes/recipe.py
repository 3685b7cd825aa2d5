"""Classes and numbers of the cubes."""

from dataclasses import dataclass


class CubesError(ValueError):
    """Silhouettes, a folder or a cube that do not fit the recipe."""


@dataclass(frozen=True)
class Recipe:
    """classes: of silhouettes, spelt as their files are.

    train, test: silhouettes of a class. Split so, and not by cube, no test outline was ever seen.
    copies: cubes of one silhouette, which differ in place and rotation.
    """

    classes: tuple[str, ...]
    train: int
    test: int
    copies: int

    @property
    def silhouettes(self) -> int:
        """Silhouettes of a class."""
        return self.train + self.test


# The classes of the original.
RECIPE = Recipe(
    classes=(
        *("apple", "bat", "bell", "brick", "camel", "car", "carriage", "chopper", "elephant"),
        *("fork", "guitar", "hammer", "Heart", "horseshoe", "key", "lmfish", "octopus", "shoe"),
        *("spoon", "tree", "turtle", "watch"),
    ),
    train=17,
    test=3,
    copies=10,
)
