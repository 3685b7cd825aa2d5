"""Which cubes there are: the classes, and how many of each."""

from dataclasses import dataclass


class CubesError(ValueError):
    """Silhouettes, a folder or a cube that are not as the recipe wants them; the message says."""


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
        """How many silhouettes a class needs."""
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
