"""Decoder of meshopt compression (KHR_meshopt_compression and EXT_meshopt_compression of glTF).

Written from the appendices of KHR_meshopt_compression, whose names it uses; the maintained decoder
has no wheels. Filters that only normals and colours have are not known.
"""

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.jit import kernel

_GROUP = 16  # elements that share a width in bits


def decompress(
    content: NDArray[np.uint8], count: int, stride: int, mode: str, filtered: str
) -> NDArray[np.uint8]:
    """The bytes of `count` elements of `stride` bytes each.

    mode: "ATTRIBUTES", "TRIANGLES" or "INDICES"; filtered: the name of the filter, or "NONE".

    Raises MalformedFile where the content is not exactly that.
    """
    content = content.copy()  # kernels are compiled once more for arrays that are read-only
    unfiltered = filtered == "NONE"
    if mode == "ATTRIBUTES" and 4 <= stride <= 256 and stride % 4 == 0:
        values = np.empty((count, stride), np.uint8)
        whole = _decode_attributes(content, values, np.empty((stride, 256), np.uint8))
        if whole and filtered == "EXPONENTIAL":
            values = _exponential(values.view("<i4")).view(np.uint8)
        elif whole and filtered == "QUATERNION" and stride == 8:
            values = _quaternion(values.view("<i2")).view(np.uint8)
        elif not unfiltered:
            raise _wrong(f"the filter {filtered!r:.40}")
    elif mode == "TRIANGLES" and count % 3 == 0 and stride in (2, 4) and unfiltered:
        indices = np.empty(count, np.uint32)
        whole = _decode_triangles(content, indices)
        values = indices.astype(f"<u{stride}").view(np.uint8)
    elif mode == "INDICES" and stride in (2, 4) and unfiltered:
        indices = np.empty(count, np.uint32)
        whole = _decode_indices(content, indices)
        values = indices.astype(f"<u{stride}").view(np.uint8)
    else:
        raise _wrong(f"{count} elements of {stride} bytes in mode {mode!r:.40}")
    if not whole:
        raise MalformedFile(
            "bad-meshopt", "data that is packed by meshopt is damaged; export the file again"
        )
    return values.reshape(-1)


def _wrong(what: str) -> MalformedFile:
    return MalformedFile(
        "unsupported-feature",
        f"data that is packed by meshopt has {what}, which is not read; "
        "export as plain glTF 2.0 without it",
    )


@kernel
def _decode_attributes(content, values, deltas):
    """Fill `values` (N x stride) from an attribute stream; whether that was whole.

    deltas: room for stride x 256. Loops, not slices, which take longer to compile.
    """
    count, stride = values.shape
    if len(content) < 1 or content[0] not in (0xA0, 0xA1):
        return False
    version = content[0] & 1
    tail = stride + (stride // 4 if version else 0)
    end = len(content) - max(tail, 24 if version else 32)
    if end < 1:
        return False
    first = len(content) - tail  # of the element from which the first differs
    channels = len(content) - stride // 4
    for channel in range(channels, len(content)):
        mode = content[channel]
        if version and (mode & 15 > 2 or (mode & 15 < 2 and mode >> 4)):
            return False
    most = min((8192 // stride) & ~(_GROUP - 1), 256)
    position = 1
    for start in range(0, count, most):
        size = min(most, count - start)
        control = position
        if version:
            position += stride // 4
            if position > end:
                return False
        for byte in range(stride):
            widths = -1
            if version:
                widths = content[control + byte // 4] >> (byte % 4 * 2) & 3
            position = _read_deltas(content, position, end, widths, size, deltas, byte)
            if position < 0:
                return False
        for byte in range(stride):
            mode = content[channels + byte // 4] if version else 0
            before = np.int64(values[start - 1, byte] if start else content[first + byte])
            if mode == 0:
                for element in range(size):
                    delta = np.int64(deltas[byte, element])
                    before += -(delta & 1) ^ (delta >> 1)
                    values[start + element, byte] = before & 255
            elif byte % 4 == 0:
                for element in range(start, start + size):
                    for place in range(byte, byte + 4):
                        last = values[element - 1, place] if element else content[first + place]
                        values[element, place] = last
                    _add_delta(values, element, byte, deltas, element - start, mode)
    return position == end


@kernel
def _read_deltas(content, position, end, widths, count, deltas, byte):
    """One byte of each of `count` elements; where the next ones begin, or -1.

    widths: the control mode, which says which widths in bits groups have; -1 in version 0.
    """
    if widths == 2 or widths == 3:
        if widths == 3 and position + count > end:
            return -1
        for element in range(count):
            deltas[byte, element] = content[position + element] if widths == 3 else 0
        return position + count if widths == 3 else position
    groups = (count + _GROUP - 1) // _GROUP
    header = position
    position += (groups + 3) // 4
    if position > end:
        return -1
    for group in range(groups):
        code = content[header + group // 4] >> (group % 4 * 2) & 3
        # The widths are 0 1 2 4 in control mode 0, 1 2 4 8 in mode 1, and 0 2 4 8 in version 0.
        bits = 1 << code if widths == 1 or (widths < 0 and code) else (1 << code) >> 1
        escaped = position + 2 * bits  # whole bytes of what does not fit
        if escaped > end:
            return -1
        row = group * _GROUP
        if bits == 0 or bits == 8:
            for place in range(_GROUP):
                deltas[byte, row + place] = content[position + place] if bits else 0
            position = escaped
            continue
        full = (1 << bits) - 1
        for place in range(0, _GROUP * bits, bits):
            # Of one bit the first is the lowest, of more the highest.
            offset = place & 7 if bits == 1 else 8 - bits - (place & 7)
            value = np.int64(content[position + (place >> 3)]) >> offset & full
            if value == full:
                if escaped >= end:
                    return -1
                value = np.int64(content[escaped])
                escaped += 1
            deltas[byte, row] = value
            row += 1
        position = escaped
    return position


@kernel
def _add_delta(values, element, byte, deltas, row, channel):
    """Move four bytes of an element, which are those of the one before it, by their deltas.

    channel: whether these are of two bytes (1), or bits of four bytes that change (2), turned by
    its upper four bits.
    """
    mode, turn = channel & 15, channel >> 4
    if mode == 1:
        for place in (byte, byte + 2):
            delta = np.int64(deltas[place, row]) | np.int64(deltas[place + 1, row]) << 8
            value = np.int64(values[element, place]) | np.int64(values[element, place + 1]) << 8
            value += -(delta & 1) ^ (delta >> 1)
            values[element, place] = value & 255
            values[element, place + 1] = value >> 8 & 255
    else:
        bits = np.int64(0)
        for place in range(4):
            bits |= np.int64(deltas[byte + place, row]) << (8 * place)
        bits = (bits >> turn | bits << (32 - turn)) & 0xFFFFFFFF
        for place in range(4):
            values[element, byte + place] ^= bits >> (8 * place) & 255


@kernel
def _decode_indices(content, indices):
    """Fill `indices` from an index stream; whether that was whole."""
    end = len(content) - 4
    if end < 1 or content[0] != 0xD1:
        return False
    last = np.zeros(2, np.int64)
    position = 1
    for place in range(len(indices)):
        value, position = _read_varint(content, position, end)
        if position < 0:
            return False
        baseline = value & 1
        last[baseline] += -(value >> 1 & 1) ^ (value >> 2)
        indices[place] = last[baseline] & 0xFFFFFFFF
    return position == end


@kernel
def _decode_triangles(content, indices):
    """Fill `indices` (three a triangle) from a triangle stream; whether that was whole."""
    triangles = len(indices) // 3
    end = len(content) - 16
    position = 1 + triangles
    if end < position or content[0] != 0xE1:
        return False
    edges = np.zeros((16, 2), np.int64)
    vertices = np.zeros(16, np.int64)
    edge_count = vertex_count = 0  # ever pushed; the latest lies at (count - 1) % 16
    after = last = 0  # `next` and `last` of the specification
    corners = np.zeros(3, np.int64)
    explicit = np.zeros(3, np.bool_)
    for triangle in range(triangles):
        code = np.int64(content[1 + triangle])
        upper, lower = code >> 4, code & 15
        if upper < 15:
            if upper >= edge_count:
                return False
            edge = (edge_count - 1 - upper) % 16
            a, b = edges[edge, 0], edges[edge, 1]
            pushed = True
            if lower == 0:
                c = after
                after += 1
            elif lower < 13:
                if lower >= vertex_count:
                    return False
                c = vertices[(vertex_count - 1 - lower) % 16]
                pushed = False
            elif lower < 15:
                last += 1 if lower == 14 else -1
                c = last
            else:
                value, position = _read_varint(content, position, end)
                if position < 0:
                    return False
                last += -(value & 1) ^ (value >> 1)
                c = last
            if pushed:
                vertices[vertex_count % 16] = c
                vertex_count += 1
        else:
            if lower < 14:
                pair = np.int64(content[end + lower])
                first = 0
            else:
                if position >= end:
                    return False
                pair = np.int64(content[position])
                position += 1
                if pair == 0:
                    after = 0
                first = 0 if lower == 14 else 15
            read = vertex_count  # vertices that the FIFO has before those of this triangle
            for corner in range(3):
                place = first if corner == 0 else (pair >> 4 if corner == 1 else pair & 15)
                explicit[corner] = place in (0, 15)
                if place == 0:
                    corners[corner] = after
                    after += 1
                elif place < 15:
                    if place > read:
                        return False
                    corners[corner] = vertices[(read - place) % 16]
                elif lower < 14:
                    return False
                else:
                    value, position = _read_varint(content, position, end)
                    if position < 0:
                        return False
                    last += -(value & 1) ^ (value >> 1)
                    corners[corner] = last
            for corner in range(3):
                if explicit[corner]:
                    vertices[vertex_count % 16] = corners[corner]
                    vertex_count += 1
            a, b, c = corners[0], corners[1], corners[2]
            edges[edge_count % 16, 0] = b
            edges[edge_count % 16, 1] = a
            edge_count += 1
        edges[edge_count % 16, 0] = c
        edges[edge_count % 16, 1] = b
        edges[(edge_count + 1) % 16, 0] = a
        edges[(edge_count + 1) % 16, 1] = c
        edge_count += 2
        indices[3 * triangle] = a & 0xFFFFFFFF
        indices[3 * triangle + 1] = b & 0xFFFFFFFF
        indices[3 * triangle + 2] = c & 0xFFFFFFFF
    return position == end


@kernel
def _read_varint(content, position, end):
    """The number at `position`, seven bits a byte, and where the next begins, or -1."""
    value = np.int64(0)
    for place in range(5):
        if position >= end:
            return value, -1
        byte = np.int64(content[position])
        position += 1
        value |= (byte & 127) << (7 * place)
        if byte < 128:
            return value & 0xFFFFFFFF, position
    return value, -1


def _exponential(values: NDArray[np.int32]) -> NDArray[np.float32]:
    """Numbers of 8 bits of exponent and 24 of mantissa as float32."""
    return np.ldexp((values << 8 >> 8).astype("<f4"), values >> 24)


def _quaternion(values: NDArray[np.int16]) -> NDArray[np.int16]:
    """N x 4: three components and the place of the largest as four components, 32767 for one."""
    one = (values[:, 3] | 3).astype(np.float32)
    largest = values[:, 3] & 3
    with np.errstate(invalid="ignore"):
        xyz = values[:, :3] / one[:, None] * np.float32(np.sqrt(0.5))
        w = np.sqrt(np.maximum(1 - (xyz * xyz).sum(axis=1), 0))
    turned = np.empty((len(values), 4), "<i2")
    for place, component in enumerate((w, *xyz.T)):
        scaled = np.round(component * 32767).astype(np.int64)
        turned[np.arange(len(values)), (largest + place) % 4] = scaled
    return turned
