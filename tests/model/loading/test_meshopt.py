"""Meshopt compression: streams of its own encoder, and streams that are damaged or lie."""

from base64 import b85decode

import numpy as np
import pytest

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading.gltf.meshopt import decompress

# What meshoptimizer's encoder makes of the arrays below, as base 85. "floats 1" has deltas of bits,
# "shorts 1" of two bytes.
STREAMS = {
    "floats 0": (
        "pa1|b0RR7hfIvV%Kp-F>ARr(hAP^7`5D*X$5D*X$5D*X$_=t#z000005D_>4fB<}e0000003QGV|A2r%"
        "Kz{)LfPg?ie*pi0fIvWh0RMo1KtO*0|A7BL004kMK!5*$fE6%<!Vi9bet&)lJRtCYet&+0!T<n&egGT*"
        "|NsC0|Nnr0fPa90fPaAh{{R4gK)}C0K)}Br0RI5r;E<4LctlK8JTf*qJ|H9{C@3r>7#JEF92_1V|Nj60"
        "AP^7|5)u*=1v&@-fOr4`0000000000000000000000000000000000000000000"
    ),
    "floats 1": (
        "p=fD%0RjOJ9~uw;`1th1^u(ZG5HJ|{9P(n~V)A0*Vmuz*-2ec70|x^Y5W+(V0|N{sFpvWS!b1Q60|Oa8"
        "-urv_1pWi~1pWi~Lh&;6FB309{`mg*-unOm{sZ^~{s96I0RsR40Dyo%z@Q)yP|y&_XebDTl(giebh4si"
        "s``?$nu>x!#ZB2s{Z$4Jk3!;MG4V0v9RI|}1jGje4+9YZ2LS*8000000000000000000000001DGBN"
    ),
    "shorts 0": (
        "pdSEOSXfwCSXfwCSXfwCSXfwCSXfwCSXfwCSXfwCSXlr6003B6SXfwCSXdP*uBz$;1g@&;t^@=GtEvD1"
        "1QjZ}uB!(J2de72t_KGPtEvD12LK-c0R;&S5fvF7Atfm-F*P|oK}AVTQB_%8VP$D;admnB{{R4efrW{U"
        "k(HSgKmh<iKtTWi00000000000000000000000000000000000008I%000"
    ),
    "shorts 1": (
        "p_i)wSXfwCSXfwCSXfwCSXfwCSXfwCSXfwCSXfwCSXfwCSXfwCSXfvUDypigs;a80s;U406)L)}s|N=M"
        "s_MF~2L}hMssI27009LF4G|R?9U&ztEipAYJwZiDO;J@@U14QuZE<yZeSw9Ejggg^000000000000000"
        "00000008I%00032"
    ),
    "triangles": (
        ";r{;q{{H^{{{H^{{{H^||NsC0|NsC0|NsC0|NsC0|NsC0|NsC0|NsC0|NsC0|NsC0|NsC0{{H^{{{H^{"
        "{{H^{{{H^{{{H^{{{H^{{{H^{{{H^{{{H^{{{H^{{{H^||NsC0|NsC0|NsC0|NsC0|NsC0|NsC0|NsC0"
        "|NsC0|NsC0|NsC0|NsC0|NsC0|NsC0|NsC0|NsC0|NsC0|NsC0|NsC0|NsC0|NsC0|NsC0|NsC0|NsC0"
        "|NsC0|NsC04-)bM@&fV#@&fV#@&exk-vZwP-vZwP-vZwP-whJq4-(%G65kIJ-wzVs4-(%G65kCH-wzVs"
        "4-(%G65kIJ-wzVs4-(%E65kIJ-wzVs4-(%G65kIJ-wzVs4HDlE65kIJ-wzVs4-(%G65kIJ-whJq4-(%G"
        "65kIJ-wzVs4-(%G690V?0rCwJ@edO54-)YY67dfb9}mzU1}_3H0xtqD0xtsK9|kW1F9I(DF9I(D;2#Dr"
        "0xtqD0xtqD0^lD8F9I(DF9I(DF9P5n1}_3H0xtqD0xtsK9|kW1F9I(DF9I(DBmh?diUGX=?*R}W5fC2{"
        "5c(4m%M;51%K^&)$^p3n_yZEC6PN**0hj@p0hj^!0}`kcm;smpm;smpm;v|$5~vfH0hj@p0hj@p0r&$F"
        "s1uk0m;smpm;smp_yZEC6PN**0hj@p0hj^*YyuEJ6A~{I5-$@HFB1|k6A~{I68;qeF9Q-U6A~{I5-$@H"
        "FB1|k6B7Lu0xts+FB1|k6A~{I5-$@HFB1~|6#_2<5-$@HFB1|k6A~{I5-$@H{S^W)0}?M25-$@HFB1|k"
        "6A~{I68#kdF9Q-U6A~{I5-$@HFB1|k6B7Lu0xts+FB1|k6A~{I5-$@HFB1~~xS9+C5dS^`5dTvG5CC?E"
        "R%dvrhGmIpm;q@300"
    ),
    "indices": (
        "(EtP>9t0pB1Rx#+ARYuD9t0pB1Rxp&ARYuD9t0pB1Rx#+ARYuD9t0p71Rx#+ARYuD9t0pB1Rx#+Ac3_QY5)KL00"
    ),
    "quaternions": (
        "paBm6008^^0S^EG0JO6K4*&oF`#S*-0002Aasdwj008^^0S^EG0JO6KGXMYp1qJ{B000000000000000"
        "000000000000000000000RMj"
    ),
    "exponents": (
        "pa3fXfB-;0ARr)L5D*X$5D*afh=_=Yh=_=9^h88N00000cK{U_fPesi0001h000009{_*=KtCWLzkmQh"
        "KOi8#fB-;0ARxbh06;$=AisbBK>yDG06!ogzkonL02K&>A`Alqh%z9^0|SF10009W0000#|NsC0fPa90"
        "fPX+gK)}C0K)}EM{{R3#AYh>2-=AME0Du4x4@fsOLn0<BVHg}7Ul0-!6ciS13=9ko4h{|w_=u>g00000"
        "ZvYiOh=70z1b_kn0Du4h000000000000000000000000000000@c;k-@c;k-@c"
    ),
}
STEPS = np.arange(40)
FLOATS = np.stack([STEPS * 0.25, STEPS % 7 * 0.5, STEPS * STEPS / 64], axis=1).astype("<f4")
SHORTS = np.stack([300 * STEPS, STEPS % 5, 1000 - STEPS * STEPS, 0 * STEPS], axis=1).astype("<i2")


def _grid() -> np.ndarray:
    """The triangles of a grid of 8 x 8 vertices."""
    grid = np.arange(64).reshape(8, 8)
    corners = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    quads = np.stack(corners, axis=-1).reshape(-1, 4)
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


GRID = _grid()
TRIANGLES = np.concatenate([GRID, GRID[::-1], GRID[[5, 40, 11]] + 100_000])
INDICES = np.array([*GRID.ravel()[:60], 100_000, 3])
QUATERNIONS = np.array([[0, 0, 0, 1], [1, 0, 0, 0], [0.5, 0.5, 0.5, 0.5], [0, 0.6, 0, -0.8]])


def stream(name: str) -> np.ndarray:
    return np.frombuffer(b85decode(STREAMS[name]), np.uint8)


@pytest.mark.parametrize("version", [0, 1])
def test_attributes_come_out_as_they_went_in(version):
    for name, table in (("floats", FLOATS), ("shorts", SHORTS)):
        size = table.nbytes // len(table)
        found = decompress(stream(f"{name} {version}"), len(table), size, "ATTRIBUTES", "NONE")
        assert np.array_equal(found.view(table.dtype).reshape(table.shape), table)


def test_indices_come_out_as_they_went_in():
    found = decompress(stream("indices"), len(INDICES), 4, "INDICES", "NONE")
    assert np.array_equal(found.view("<u4"), INDICES)
    short = decompress(stream("indices"), len(INDICES), 2, "INDICES", "NONE")
    assert np.array_equal(short.view("<u2"), INDICES % 2**16)


def test_triangles_come_out_with_their_corners_in_turn():
    found = decompress(stream("triangles"), TRIANGLES.size, 4, "TRIANGLES", "NONE")
    corners = found.view("<u4").reshape(-1, 3)
    turned = np.stack([np.roll(corners, turn, axis=1) for turn in range(3)])
    assert (turned == TRIANGLES).all(axis=2).any(axis=0).all()


def test_filters_give_floats_and_quaternions():
    found = decompress(stream("exponents"), 40, 12, "ATTRIBUTES", "EXPONENTIAL").view("<f4")
    assert np.allclose(found.reshape(40, 3), FLOATS, atol=1e-3)
    found = decompress(stream("quaternions"), 4, 8, "ATTRIBUTES", "QUATERNION").view("<i2")
    # A quaternion and its negative turn alike.
    assert np.allclose(
        np.abs((found.reshape(4, 4) / 32767 * QUATERNIONS).sum(axis=1)), 1, atol=1e-3
    )


SIZES = {
    "floats 0": (40, 12, "ATTRIBUTES"),
    "floats 1": (40, 12, "ATTRIBUTES"),
    "shorts 1": (40, 8, "ATTRIBUTES"),
    "triangles": (TRIANGLES.size, 4, "TRIANGLES"),
    "indices": (len(INDICES), 4, "INDICES"),
}


@pytest.mark.parametrize("name", SIZES)
def test_a_stream_of_another_length_is_damaged(name):
    count, size, mode = SIZES[name]
    whole = stream(name)
    for damaged in (whole[:-1], whole[:20], whole[:1], whole[:0], np.append(whole, whole[-1:])):
        with pytest.raises(MalformedFile) as caught:
            decompress(damaged, count, size, mode, "NONE")
        assert caught.value.fault == "bad-meshopt"
    for wrong in (count - 30, 300 * count):
        with pytest.raises(MalformedFile):
            decompress(whole, wrong, size, mode, "NONE")


@pytest.mark.parametrize("name", SIZES)
def test_any_bytes_are_values_or_an_error(name):
    count, size, mode = SIZES[name]
    random = np.random.default_rng(0)
    for _ in range(300):
        damaged = stream(name).copy()
        damaged[random.integers(len(damaged), size=3)] = random.integers(0, 256, 3)
        try:
            assert len(decompress(damaged, count, size, mode, "NONE")) == count * size
        except MalformedFile:
            continue


@pytest.mark.parametrize(
    ("size", "mode", "filtered"),
    [
        (3, "ATTRIBUTES", "NONE"),
        (260, "ATTRIBUTES", "NONE"),
        (12, "ATTRIBUTES", "QUATERNION"),
        (12, "ATTRIBUTES", "OCTAHEDRAL"),
        (12, "TRIANGLES", "NONE"),
        (4, "SPLATS", "NONE"),
    ],
)
def test_modes_that_are_not_read_are_named(size, mode, filtered):
    with pytest.raises(MalformedFile, match=mode if filtered == "NONE" else filtered) as caught:
        decompress(stream("floats 0"), 40, size, mode, filtered)
    assert caught.value.fault == "unsupported-feature"
