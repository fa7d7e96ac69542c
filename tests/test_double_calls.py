"""A second call at the same tick of the clock, of every kind of controller that has one: it says no less of the device than the first,
and never gives the hardware a drive beyond its limits, whatever `out` holds."""

from __future__ import annotations

import subprocess

import pytest
from conftest import SCENARIOS

import ctrlgen
from ctrlgen import build_model, generate, load_device, load_scenario
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.toolchains import FLAGS

HEATERS = 'kind = "circle"\ndiameter = "6 um"\ncentre = { x = "6 um", y = "6 um" }\nplane = ["x", "y"]\n'
LINE = 'kind = "line"\nstart = { axis = "-20 um" }\nend = { axis = "30 um" }\n'


def heated(**other):
    """Two heaters whose temperatures lag by 20 ms: 10 K/W, and 0.1 um/K."""
    return ctrlgen.user_device(
        "heated",
        parameters={"tau": "20 ms", "r": "10 K/W", "g": "0.1 um/K", "k": "1 N/um"},
        state={"a": ("-10 K", "120 K"), "b": ("-10 K", "120 K")},
        drive={"x": ("0 W", "12 W"), "y": ("0 W", "12 W")},
        axes={"x": ("-1 um", "12 um"), "y": ("-1 um", "12 um")},
        rates=lambda u, x, p: [(p.r * u.x - x.a) / p.tau, (p.r * u.y - x.b) / p.tau],
        force=lambda x, p: [p.k * p.g * x.a, p.k * p.g * x.b],
        restoring_force=lambda d, p: p.k * d.vector,
        **other,
    )


def coil(**other):
    """An axis with inertia."""
    return ctrlgen.user_device(
        "coil",
        parameters={"m": "0.5 kg", "c": "200 N*s/m", "k": "0.2 N/um", "f": "10 N/A"},
        axes={"axis": "100 um"},
        drive={"coil": "4 A"},
        force=lambda u, p: p.f * u.coil,
        mass=lambda p: p.m,
        restoring_force=lambda d, p: p.k * d.axis,
        damping_force=lambda v, p: p.c * v.axis,
        **other,
    )


# what: the device, its path, more of the scenario, limits of its drives
KINDS = {
    "heaters": (heated, HEATERS, "", (0.0, 12.0)),
    "heaters with rates": (lambda: heated(drive_rate={"x": "1 W/ms", "y": "1 W/ms"}), HEATERS, "", (0.0, 12.0)),
    "times that vary": (heated, HEATERS, 'sample_times = ["0.5 ms", "2 ms"]\n', (0.0, 12.0)),
    "checksum": (heated, HEATERS, "checksum = true\n", (0.0, 12.0)),
    "given at the start": (
        lambda: load_device(SCENARIOS / "devices" / "mems_hexapod_run_time.toml"),
        'kind = "circle"\ndiameter = "20 um"\ncentre = { delta_z = "20 um" }\n',
        "",
        (0.0, 1.0),
    ),
    "mass": (coil, LINE, "", (-4.0, 4.0)),
    "mass with rates": (lambda: coil(drive_rate={"coil": "150 A/s"}), LINE, "", (-4.0, 4.0)),
}

MAIN = """
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "{name}.h"
#define SIZE {U}_DRIVE_SIZE
static {online}_output out, before;
static {name}_state state, kept;
static const {real} target[{U}_TARGET_SIZE] = {{ 0 }};
static void fresh(int known)
{{
    {name}_init(&state);
    if (known == 0) {{ (void){name}_forget(&state); }}
    (void){name}_step_at(&state, 7U, target, &out);
}}
int main(void)
{{
    static const {real} WRONG[] = {{ ({real})NAN, ({real})INFINITY, -({real})INFINITY, ({real})12689.6, ({real})-12689.6 }};
    unsigned k, i, known, wrong = 0;
    for (known = 0; known < 2; known++) {{ /* in use: nothing changes, and the bit UNSURE is that of the next sample */
        unsigned next;
        unsigned twice;
        fresh((int)known);
        before = out;
        kept = state;
        twice = {name}_step_at(&state, 7U, target, &out);
        if ((memcmp(&before, &out, sizeof out) != 0) || (memcmp(&kept, &state, sizeof state) != 0)) {{ wrong |= 1; }}
        next = {name}_step_at(&state, 8U, target, &out);
        if (twice != ({U}_CLOCK | (next & {U}_UNSURE))) {{ wrong |= 2; }}
        if ((known == 0) != ((twice & {U}_UNSURE) != 0U)) {{ wrong |= 4; }}
    }}
    for (k = 0; k < sizeof WRONG / sizeof WRONG[0]; k++) {{
        for (i = 0; i < SIZE; i++) {{ /* an output that is another one */
            unsigned told, j;
            fresh(1);
            before = out;
            out.drive[i] = WRONG[k];
            told = {name}_step_at(&state, 7U, target, &out);
            if (told != ({U}_CLOCK | {U}_UNSURE)) {{ wrong |= 8; }}
            for (j = 0; j < SIZE; j++) {{
                if (!((out.drive[j] >= ({real}){low}) && (out.drive[j] <= ({real}){high}))) {{ wrong |= 16; }}
                if (({rated} != 0) && (memcmp(&out.drive[j], &before.drive[j], sizeof out.drive[j]) != 0)) {{ wrong |= 32; }}
            }}
            if (({name}_step_at(&state, 8U, target, &out) & ({U}_UNSURE | {U}_CLOCK | {U}_LOST)) != {U}_UNSURE) {{ wrong |= 64; }}
        }}
    }}
    (void)printf("%u\\n", wrong);
    return 0;
}}
"""


@pytest.fixture(scope="module", params=list(KINDS))
def made(request, tmp_path_factory):
    device, path, more, limits = KINDS[request.param]
    device, out = device(), tmp_path_factory.mktemp("c")
    file = out / "scenario.toml"
    file.write_text(
        f'title = "t"\ndevice = "{device.name}"\nsample_rate = "1 kHz"\nduration = "0.05 s"\n{more}[path]\n{path}'
    )
    scenario = load_scenario(out, device)
    return generate(scenario, build_model(device), out / "c"), limits, "rates" in request.param


@pytest.mark.parametrize("real", list(Real))
def test_a_second_call_in_a_sample_changes_nothing_and_hides_nothing(made, compiler, real, tmp_path):
    folder, (low, high), rated = made
    online = folder.online[real]
    for name in filter(None, (online, folder.checked.get(real))):
        more = {"low": low, "high": high, "rated": int(rated)}
        assert answered(folder, name, MAIN, compiler, real, tmp_path, **more) == ["0"], name


TOLD = """
#include <stdio.h>
#include <string.h>
#include "{online}.h"
static {online}_output out;
static {online}_state told, found, late;
static const {real} target[{U}_TARGET_SIZE] = {{ {far} }};
static {online}_output held;
static const {real} off[{U}_DRIVE_SIZE] = {{ 0 }};
int main(void)
{{
    static const uint32_t TICKS[] = {{ 0U, 1U, 5U, 35U, 64U, 65U, 200U }};
    unsigned k, wrong = 0;
    for (k = 0; k < sizeof TICKS / sizeof TICKS[0]; k++) {{
        const uint32_t n = TICKS[k], first = 0xFFFFFFF0U;
        {online}_init(&told);
        (void){online}_step_at(&told, first, target, &out);
        held = out;
        if (held.drive[{U}_DRIVE_SIZE - 1U] == 0) {{ wrong |= 16; }}
        found = told; /* as if it were told of nothing: under the drive that was held, so that it finds the same */
        late = told;
        (void){online}_elapsed(&told, n, out.drive);
        if ({online}_step_at(&told, first + n + 1U, target, &out) & {U}_CLOCK) {{ wrong |= 1; }}
        out = held;
        (void){online}_step_at(&found, first + n + 1U, target, &out);
        if (memcmp(&told, &found, sizeof told) != 0) {{ wrong |= 2; }}
        told = late; /* the amplifier was off, then it stepped as it does without a clock */
        found = late;
        (void){online}_elapsed(&told, n, off);
        (void){online}_step_at(&told, first + n + 1U, target, &out);
        (void){online}_elapsed(&found, n, off);
        (void){online}_step(&found, target, &out);
        found.tick = told.tick;
        if (memcmp(&told, &found, sizeof told) != 0) {{ wrong |= 4; }}
        told = late; /* told of some of the samples */
        out = held;
        (void){online}_elapsed(&told, n, out.drive);
        if (({online}_step_at(&told, first + n + 4U, target, &out) & {U}_CLOCK) == 0U) {{ wrong |= 8; }}
    }}
    (void)printf("%u\\n", wrong);
    return 0;
}}
"""


def answered(folder, name, text, compiler, real, scratch, **more):
    """What a program prints that calls the controller `name` of the folder."""
    online = folder.online[real]
    far = "0, 0, 0, 0, 0, (float)2e-5" if "hexapod" in online else "(float)5e-6, (float)5e-6"
    far = "(float)5e-6" if "coil" in online else far
    (scratch / "main.c").write_text(
        text.format(name=name, online=online, U=online.upper(), real=real.value, far=far, **more)
    )
    words = [compiler, *FLAGS[:1], *FLAGS[-2:], f"-I{folder.path}", scratch / "main.c", folder.path / f"{online}.c"]
    words += [folder.path / f"{name}.c"] * (name != online)
    subprocess.run([*map(str, words), "-lm", "-o", str(scratch / "main")], check=True)
    return subprocess.run([str(scratch / "main")], capture_output=True, text=True).stdout.split()


@pytest.mark.parametrize("real", list(Real))
def test_samples_that_the_program_tells_of_are_not_made_up_for_again(made, compiler, real, tmp_path):
    """Else UNSURE ends in half the time, and a device whose amplifier was off is believed under drives."""
    folder, *_ = made
    assert answered(folder, folder.online[real], TOLD, compiler, real, tmp_path) == ["0"]


MIXED = """
#include <stdio.h>
#include <string.h>
#include "{name}.h"
static {name}_state clocked, mixed, held;
static {online}_output told, out;
static const {real} TARGET[2][{U}_TARGET_SIZE] = {{ {{ 0 }}, {{ {far} }} }};
static uint32_t seed = 12345U;
static uint32_t drawn(uint32_t below)
{{
    seed = (seed * 1664525U) + 1013904223U;
    return (seed >> 8) % below;
}}
/* A clock, and one that some of the calls do not read: step, settle, samples that are told. Wrong: a bit for each promise. */
int main(void)
{{
    unsigned wrong = 0U, k, seen = 0U;
    uint32_t tick = 0xFFFFFE00U;
    {name}_init(&clocked);
    {name}_init(&mixed);
    for (k = 0U; k < 2000U; k++) {{
        const uint32_t call = (k == 0U) ? 0U : drawn(8U), missed = drawn(5U);
        const {real} *target = TARGET[drawn(2U)];
        uint32_t one, two, clock = 0U;
        if (call == 1U) {{ /* missed, and told of to one of them */
            (void){name}_elapsed(&mixed, missed, out.drive);
            tick += missed;
            clock = (missed != 0U) ? {U}_CLOCK : 0U;
        }}
        tick += 1U;
        if (call == 2U) {{
            one = {name}_settle(&clocked, target, &told);
            two = {name}_settle(&mixed, target, &out);
        }} else if ((call == 3U) || (call == 4U)) {{
            one = {name}_step_at(&clocked, tick, target, &told);
            two = {name}_step(&mixed, target, &out);
        }} else {{
            one = {name}_step_at(&clocked, tick, target, &told);
            two = {name}_step_at(&mixed, tick, target, &out);
        }}
        seen |= 1U << call;
        if ((call == 2U) ? (one != two) : (one != (two | clock))) {{ wrong |= 1U; }}
        if ((memcmp(&clocked, &mixed, sizeof mixed) != 0) || (memcmp(&told, &out, sizeof out) != 0)) {{ wrong |= 2U; }}
    }}
    held = mixed;
    (void){name}_step(&mixed, TARGET[1], &out); /* twice in a sample: the next one is none */
    (void){name}_step(&mixed, TARGET[1], &out);
    if (({name}_step_at(&mixed, tick + 2U, TARGET[1], &out) & {U}_CLOCK) == 0U) {{ wrong |= 4U; }}
    if (({name}_step_at(&mixed, tick + 3U, TARGET[1], &out) & {U}_CLOCK) != 0U) {{ wrong |= 8U; }}
    mixed = held;
    for (k = 0U; k < 3U; k++) {{ (void){name}_step(&mixed, TARGET[1], &out); }} /* thrice: it went back */
    {{
        const uint32_t back = {name}_step_at(&mixed, tick + 2U, TARGET[1], &out);
        if ((back & ({U}_CLOCK | {U}_UNSURE)) != ({U}_CLOCK | {U}_UNSURE)) {{ wrong |= 16U; }}
    }}
#ifdef {U}_SHORTEST
    {name}_init(&mixed); /* how many samples that took is not known */
    (void){name}_step_at(&mixed, 1U, TARGET[1], &out);
    if (({name}_step_after(&mixed, ({real})9e-4, ({real})2e-3, TARGET[1], &out) & ({U}_CLOCK | {U}_UNSURE)) != 0U) {{ wrong |= 32U; }}
    {{
        const uint32_t uncounted = {name}_step_at(&mixed, 2U, TARGET[1], &out);
        if ((uncounted & ({U}_CLOCK | {U}_UNSURE)) != ({U}_CLOCK | {U}_UNSURE)) {{ wrong |= 64U; }}
    }}
    if (({name}_step_at(&mixed, 3U, TARGET[1], &out) & {U}_CLOCK) != 0U) {{ wrong |= 128U; }}
#endif
    (void)printf("%u %u\\n", wrong, seen);
    return 0;
}}
"""


@pytest.mark.parametrize("real", list(Real))
def test_a_call_that_reads_no_clock_is_a_sample_of_it(made, compiler, real, tmp_path):
    """Else step_at makes up for samples that were stepped: a heater is believed to have been driven for twice as long."""
    folder, *_ = made
    for name in filter(None, (folder.online[real], folder.checked.get(real))):
        assert answered(folder, name, MIXED, compiler, real, tmp_path) == ["0", "255"], name


BYTES = """
#include <stdio.h>
#include <string.h>
#include "{name}.h"
int main(void)
{{
    static {name}_state one, two;
    static {online}_output told, out;
    const {real} target[{U}_TARGET_SIZE] = {{ {far} }};
    unsigned k, wrong = 0U;
    (void)memset(&one, 0xAA, sizeof one);
    (void)memset(&two, 0x55, sizeof two);
    (void)memset(&out, 0xAA, sizeof out);
    (void)memset(&told, 0x55, sizeof told);
    {name}_init(&one);
    {name}_init(&two);
    for (k = 0U; k < 3U; k++) {{
        if (memcmp(&one, &two, sizeof one) != 0) {{ wrong |= 1U << k; }}
        (void)({name}_step(&one, target, &out) | {name}_step(&two, target, &told));
        if (memcmp(&told, &out, sizeof out) != 0) {{ wrong |= 8U; }}
        if (k == 1U) {{ (void)({name}_forget(&one) | {name}_forget(&two)); }}
    }}
    (void)printf("%u\\n", wrong);
    return 0;
}}
"""


@pytest.mark.parametrize("real", list(Real))
def test_no_byte_of_a_state_is_left_to_the_compiler(made, compiler, real, tmp_path):
    """Two states that were led alike are alike byte by byte, as a firmware with two channels or a CRC over a copy compares them."""
    folder, *_ = made
    for name in filter(None, (folder.online[real], folder.checked.get(real))):
        assert answered(folder, name, BYTES, compiler, real, tmp_path) == ["0"], name
        words = [compiler, "-std=c99", "-Wpadded", "-Werror", "-fsyntax-only", "-x", "c", f"{folder.path / name}.h"]
        assert subprocess.run(words, capture_output=True).returncode == 0, name


SIZES = """
#include <stdio.h>
#include "{name}.h"
int main(void)
{{
    (void)printf("%u %u\\n", (unsigned)sizeof({online}_state), (unsigned)sizeof({online}_output));
    return 0;
}}
"""


@pytest.mark.parametrize("real", list(Real))
def test_the_readme_states_the_memory_that_a_controller_takes(made, compiler, real, tmp_path):
    folder, *_ = made
    rows = [line.split(" | ") for line in (folder.path / "README.md").read_text().splitlines()]
    told = {row[0].strip("| "): row[1 + (real is Real.DOUBLE)].removesuffix(" B") for row in rows if len(row) > 3}
    sizes = answered(folder, folder.online[real], SIZES, compiler, real, tmp_path)
    assert [told["state"], told["output"]] == sizes
