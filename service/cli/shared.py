"""What several commands do first: read the settings, open the model."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from meshconv3d.service.classifier import Classifier
    from meshconv3d.service.settings import Settings


def read_settings(flags: Mapping[str, Any]) -> "Settings":
    """The settings, with the flags that were given over them; a bad one is a usage error."""
    from pydantic import ValidationError

    from meshconv3d.service.settings import Settings

    given = {name: value for name, value in flags.items() if value not in (None, ())}
    try:
        return Settings(**given)
    except ValidationError as error:
        raise click.UsageError("; ".join(map(_bad_setting, error.errors()))) from None


def _bad_setting(error: Mapping[str, Any]) -> str:
    reason = error["msg"].removeprefix("Value error, ")
    if not error["loc"]:
        return f"bad settings: {reason}"
    name = str(error["loc"][0])
    return f"bad setting: {name} (MESHCONV3D_{name.upper()}): {reason}"


def load_classifier(model: str | None) -> "Classifier":
    """The classifier for a --model value or the settings' default, within the settings' limits
    on one file, tested on its own sample.

    A model that is missing, damaged, or does not give its own scores is a usage error.
    """
    from meshconv3d.export.metadata import ModelFileError
    from meshconv3d.service.classifier import Classifier, SelfTestError
    from meshconv3d.service.models import open_model

    settings = read_settings({})
    try:
        classifier = Classifier(open_model(model or settings.models[0]), settings.limits)
        classifier.self_test()
    except (ModelFileError, SelfTestError) as error:
        raise click.UsageError(str(error)) from None
    return classifier
