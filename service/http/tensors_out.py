"""Answers of the Open Inference Protocol: tensors in JSON, or as binary data behind it."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from meshconv3d.service.http.tensors_in import LENGTH, InferenceRequest, RequestedOutput, malformed


@dataclass(frozen=True)
class Output:
    """A tensor of an answer. values: float32 or bool of any shape, or texts."""

    name: str
    values: NDArray[np.float32] | NDArray[np.bool_] | Sequence[str]

    @property
    def datatype(self) -> str:
        if isinstance(self.values, np.ndarray):
            return "BOOL" if self.values.dtype == np.bool_ else "FP32"
        return "BYTES"

    def describe(self) -> dict:
        """Name, datatype and shape."""
        shape = self.values.shape if isinstance(self.values, np.ndarray) else (len(self.values),)
        return {"name": self.name, "datatype": self.datatype, "shape": list(shape)}

    def plain(self) -> list:
        """Its elements in a row, for JSON."""
        if isinstance(self.values, np.ndarray):
            return self.values.ravel().tolist()
        return list(self.values)

    def binary(self) -> bytes:
        """Its elements in a row, little-endian; texts each behind their length."""
        if isinstance(self.values, np.ndarray):
            return self.values.astype(self.values.dtype.newbyteorder("<")).tobytes()
        texts = [text.encode() for text in self.values]
        return b"".join(LENGTH.pack(len(text)) + text for text in texts)


def answer(
    request: InferenceRequest, model: str, outputs: Mapping[str, Output]
) -> tuple[bytes, int | None]:
    """The body of an answer with the outputs that were asked for, or all; and how many bytes of
    it are JSON, where it goes on with binary data.

    Raises MalformedFile where an output is asked for that is not there.
    """
    asked = request.outputs
    if asked is None:
        asked = [RequestedOutput(name=name) for name in outputs]
    by_default = request.parameters.get("binary_data_output", False)
    described, parts = [], []
    for wanted in asked:
        output = _output(wanted, outputs)
        entry = output.describe()
        if wanted.parameters.get("binary_data", by_default):
            parts.append(output.binary())
            entry["parameters"] = {"binary_data_size": len(parts[-1])}
        else:
            entry["data"] = output.plain()
        described.append(entry)
    document = {"model_name": model, "outputs": described}
    if request.id is not None:
        document["id"] = request.id
    head = json.dumps(document).encode()
    return b"".join([head, *parts]), len(head) if parts else None


def _output(wanted: RequestedOutput, outputs: Mapping[str, Output]) -> Output:
    if wanted.name not in outputs:
        raise malformed(f"there is no output {wanted.name!r}, but {', '.join(outputs)}")
    if "classification" in wanted.parameters:
        raise malformed("the parameter 'classification' is not supported; read the output 'class'")
    return outputs[wanted.name]
