"""Requests made from the API's own description are answered as it says.

A long run: `python -m pytest --hypothesis-profile=long tests/service/test_http_conformance.py`.
"""

import pytest
import schemathesis
from hypothesis import HealthCheck, given, settings
from schemathesis import GenerationMode
from schemathesis.core.result import Ok
from schemathesis.specs.openapi.checks import positive_data_acceptance

from tests.service.conftest import Service

# Of the examples that the profile allows, this part goes to each operation.
SHARE = 10


@pytest.fixture(scope="module")
def description(service: Service) -> schemathesis.BaseSchema:
    return schemathesis.openapi.from_url(f"{service.url}/openapi.json")


@pytest.mark.parametrize("mode", list(GenerationMode), ids=lambda mode: mode.name)
def test_answers_are_as_described(
    description: schemathesis.BaseSchema, mode: GenerationMode
) -> None:
    found = list(description.get_all_operations())
    operations = [each.ok() for each in found if isinstance(each, Ok)]
    assert len(operations) == len(found)
    assert len(operations) >= 13
    if mode is GenerationMode.NEGATIVE:  # nothing can be wrong where nothing is asked for
        operations = [each for each in operations if each.query or each.body]
        assert len(operations) >= 3
    for operation in operations:

        @settings(
            max_examples=settings().max_examples // SHARE,
            suppress_health_check=[HealthCheck.filter_too_much, HealthCheck.too_slow],
            database=None,
        )
        @given(operation.as_strategy(generation_mode=mode))
        def ask(case: schemathesis.Case) -> None:
            # No description tells how the bytes of a mesh must be.
            case.call_and_validate(excluded_checks=[positive_data_acceptance])

        ask()
