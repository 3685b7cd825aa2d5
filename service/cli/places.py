"""What the paths of a call name. What is wrong with one is a usage error."""

import os
from collections.abc import Sequence
from pathlib import Path

import click

from meshconv3d.model.loading import FORMATS
from meshconv3d.service.batch.listing import STDIN, Choice, Listing, NotListed
from meshconv3d.service.batch.sharding import Shard
from meshconv3d.service.batch.sorting import DEPTHS
from meshconv3d.service.batch.targets import NotWritten, Target


def listing_of(
    paths: Sequence[str],
    declared: str | None,
    include: Sequence[str],
    exclude: Sequence[str],
    shard: str | None,
) -> Listing:
    """The files to classify. Paths that name none are a usage error."""
    if declared and declared.lower() not in FORMATS:
        raise click.UsageError(f"unknown --format {declared!r}: choose from {', '.join(FORMATS)}")
    if declared and STDIN not in paths:
        raise click.UsageError("--format is for standard input, which no PATH names: add -")
    if paths.count(STDIN) > 1:
        raise click.UsageError("- stands for standard input, which holds one mesh: name it once")
    try:
        part = None if shard is None else Shard.parse(shard)
    except ValueError as error:
        raise click.UsageError(f"--shard {error}") from None
    try:
        return Listing(paths, Choice(include, exclude, part), declared)
    except NotListed as error:
        raise click.UsageError(str(error)) from None


def target_of(output: str, resume: bool) -> Target:
    """Where --output goes."""
    try:
        target = Target(output)
        target.check(resume)
    except NotWritten as error:
        raise click.UsageError(f"--output {error}") from None
    return target


def check_page(page: Path) -> None:
    """A report that would replace something else than a page, or that cannot be written once all
    is done, is a usage error."""
    if page.suffix.lower() != ".html":
        raise click.UsageError(f"--report {page} does not end with .html: name a page")
    if not (page.parent.is_dir() and os.access(page.parent, os.W_OK)):
        raise click.UsageError(
            f"--report {page} cannot be written: {page.parent} is no folder that you may write to"
        )


def check_folder(folder: Path, listing: Listing) -> None:
    """A folder to sort into that would itself be classified is a usage error."""
    if any(place.path == STDIN for place in listing.places):
        raise click.UsageError("--sort-into is for files: leave out -")
    for place in listing.places:
        if any(place.may_find(folder, depth) for depth in DEPTHS):
            raise click.UsageError(
                f"--sort-into {folder} lies in {place.path}, and would be classified the next "
                "time: name a folder beside it"
            )
