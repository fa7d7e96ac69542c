"""The calls of the generated C: hostile arguments, lost states, several controllers in one program, an interface that firmware pins."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import subprocess

import pytest
from conftest import ROOT, SCENARIOS
from package_programs import build

from ctrlgen import build_model, load_scenario
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.templates import ABI, hertz
from ctrlgen.firmware.fmi.plant import plant_of, write_plant
from ctrlgen.firmware.folder import generate


@pytest.mark.long
def test_null_and_hostile_calls_are_safe(circle_c, compiler, tmp_path):
    """NULL pointers, a state of garbage, times and indices out of range: a status and admissible drives."""
    online, player = circle_c.online[Real.FLOAT], circle_c.player[Real.FLOAT]
    (tmp_path / "main.c").write_text(f"""
#include "{online}.h"
#include "{player}.h"
#include <stddef.h>
int main(void)
{{
    {online}_state s;
    {online}_output o;
    const float up[6] = {{ 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 2e-5f }};
    const float zero = 0.0f;
    const float nan = zero / zero;
    float u[6];
    int i;
    {online}_init(NULL);
    if ({online}_step(NULL, up, &o) != {online.upper()}_INPUT) {{ return 1; }}
    {online}_init(&s);
    if ({online}_step(&s, NULL, &o) != {online.upper()}_INPUT) {{ return 2; }}
    if ({online}_step(&s, up, NULL) != {online.upper()}_INPUT) {{ return 3; }}
    for (i = 0; i < 6; i++) {{ s.x[i] = nan; s.z[i] = nan; }}
    if ({online}_step(&s, up, &o) != {online.upper()}_LOST) {{ return 4; }}
    for (i = 0; i < 6; i++) {{ if (o.drive[i] != 0.0f) {{ return 5; }} }}
    if ({player}_at(nan, u) != {player.upper()}_INPUT) {{ return 6; }}
    if ({player}_at(-1.0f, u) != {player.upper()}_INPUT) {{ return 7; }}
    if ({player}_at(1e30f, u) != {player.upper()}_INPUT) {{ return 8; }}
    if ({player}_at(0.9999f, u) != 0) {{ return 9; }}
    if ({player}_sample(4000000000U, u) != 0) {{ return 10; }}
    if ({player}_sample(0U, NULL) != {player.upper()}_INPUT) {{ return 11; }}
    return 0;
}}
""")
    sources = [tmp_path / "main.c", circle_c.path / f"{online}.c", circle_c.path / f"{player}.c"]
    build(
        compiler, sources, tmp_path / "main", f"-I{circle_c.path}", "-fsanitize=undefined", "-fno-sanitize-recover=all"
    )
    done = subprocess.run([tmp_path / "main"], capture_output=True, text=True)
    assert done.returncode == 0, (done.returncode, done.stderr)


@pytest.mark.long
def test_a_lost_state_is_told_and_stays_so_until_it_is_initialised(circle_c, compiler, tmp_path):
    """NaN or an absurd temperature in one place, a struct of zeros or of any repeated byte; by step and by settle."""
    online = circle_c.online[Real.FLOAT]
    (tmp_path / "main.c").write_text(f"""
#include "{online}.h"
#include <math.h>
#include <string.h>
#define LOST {online.upper()}_LOST
#define KEPT(status) (((status) & ~{online.upper()}_UNSURE) == 0U) /* which a device that settles has */
static const float up[6] = {{ 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 2e-5f }};
static {online}_output o;
static int stays_lost({online}_state *s)
{{
    const {online}_state before = *s;
    int i;
    if ({online}_step(s, up, &o) != LOST) {{ return 0; }}
    for (i = 0; i < 6; i++) {{ if (o.drive[i] != 0.0f || o.displacement[i] != 0.0f || o.state[i] != 295.15f) {{ return 0; }} }}
    if (memcmp(s->x, before.x, sizeof s->x) != 0 || memcmp(s->z, before.z, sizeof s->z) != 0) {{ return 0; }}
    {online}_state healed = *s; /* numbers alone do not help */
    for (i = 0; i < 6; i++) {{ healed.x[i] = 295.15f; healed.z[i] = 0.0f; }}
    if ({online}_step(&healed, up, &o) != LOST || {online}_settle(&healed, up, &o) != LOST) {{ return 0; }}
    {online}_init(s);
    return KEPT({online}_settle(s, up, &o)) && KEPT({online}_step(s, up, &o)) && o.drive[0] > 0.0f;
}}
int main(void)
{{
    static const float bad[] = {{ NAN, INFINITY, -INFINITY, 1e4f, -1e4f, 1e30f }};
    {online}_state s;
    unsigned i, k;
    for (i = 0; i < 256; i++) {{ (void)memset(&s, (int)i, sizeof s); if (!stays_lost(&s)) {{ return 1; }} }}
    for (i = 0; i < 6; i++) {{
        for (k = 0; k < 6; k++) {{
            {online}_init(&s);
            if (!KEPT({online}_settle(&s, up, &o))) {{ return 2; }}
            s.x[i] = bad[k];
            if (!stays_lost(&s)) {{ return 3; }}
            {online}_init(&s);
            s.z[i] = bad[k]; /* no answer of this device depends on it: repaired, or told where a limit is met */
            if (!KEPT({online}_settle(&s, up, &o)) || !(s.z[i] > 0.0f && s.z[i] < 1e-4f)) {{ return 4; }}
        }}
    }}
    return 0;
}}
""")
    build(compiler, [tmp_path / "main.c", circle_c.path / f"{online}.c"], tmp_path / "main", f"-I{circle_c.path}")
    assert subprocess.run([tmp_path / "main"]).returncode == 0


@pytest.mark.long
def test_two_controllers_link_into_one_program(circle_c, compiler, tmp_path):
    scenario = load_scenario(SCENARIOS / "rrr_circle")
    other = generate(scenario, build_model(scenario.device), tmp_path / "rrr")
    (tmp_path / "main.c").write_text("int main(void) { return 0; }\n")
    sources = [circle_c.path / f"{name}.c" for name in (*circle_c.online.values(), *circle_c.player.values())]
    sources += [other.path / f"{name}.c" for name in other.online.values()]
    build(compiler, [tmp_path / "main.c", *sources], tmp_path / "main")


@pytest.mark.long
def test_two_trajectories_of_one_device_and_rate_have_the_same_online_controller(circle_c, circle, tmp_path):
    spiral, raster = (load_scenario(SCENARIOS / name) for name in ("spiral", "raster"))
    same, slower = (generate(s, build_model(s.device), tmp_path / s.name) for s in (spiral, raster))
    for real in Real:
        for ending in ("h", "c"):
            here, there, elsewhere = (
                (c.path / f"{c.online[real]}.{ending}").read_bytes() for c in (circle_c, same, slower)
            )
            assert here == there
            assert ending == "c" or here != elsewhere  # 500 Hz instead of 1 kHz
    for name in (circle.scenario.name, spiral.name):
        assert name not in (circle_c.path / f"{circle_c.online[Real.FLOAT]}.h").read_text()


@pytest.mark.long
def test_controllers_of_one_device_at_two_rates_with_two_names_link_into_one_program(
    circle_c, circle, compiler, tmp_path
):
    """Both controllers and both plants; each has the rate of its own."""
    text = circle.scenario.inputs["scenario"].text.replace("../devices", str(SCENARIOS / "devices"))
    text = text.replace('sample_rate = "1 kHz"', 'sample_rate = "2 kHz"\ncontroller = "fast_hexapod"')
    (tmp_path / "scenario.toml").write_text(text)
    scenario = load_scenario(tmp_path)
    fast = generate(scenario, build_model(scenario.device), tmp_path / "fast")
    names = [circle_c.online[Real.FLOAT], fast.online[Real.FLOAT]]
    plants = [write_plant(s, plant_of(s), Real.FLOAT, tmp_path) for s in (circle.scenario, scenario)]
    assert names == ["mems_hexapod_online_f32", "fast_hexapod_online_f32"]
    assert plants == ["mems_hexapod_plant_f32", "fast_hexapod_plant_f32"]
    headers = "\n".join(f'#include "{name}.h"' for name in (*names, *plants))
    calls = "\n".join(
        f"""    {{
        static {name}_state state;
        {name}_output out;
        {name}_init(&state);
        if (({name.upper()}_RATE_HZ != {rate}U) || ({name}_step(&state, target, &out) == {name.upper()}_LOST)) {{ return {rate}; }}
    }}"""
        for name, rate in zip(names, (1000, 2000), strict=True)
    )
    target = "static const float target[6] = { 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 2e-5f };"
    (tmp_path / "main.c").write_text(f"{headers}\n{target}\nint main(void)\n{{\n{calls}\n    return 0;\n}}\n")
    sources = [
        circle_c.path / f"{names[0]}.c",
        fast.path / f"{names[1]}.c",
        *(tmp_path / f"{name}.c" for name in plants),
    ]
    build(
        compiler,
        [tmp_path / "main.c", *sources],
        tmp_path / "main",
        f"-I{circle_c.path}",
        f"-I{fast.path}",
        f"-I{tmp_path}",
    )
    assert subprocess.run([tmp_path / "main"]).returncode == 0
    for text in ("README.md", "library.properties", "zephyr/Kconfig"):
        assert "mems_hexapod_online" not in (fast.path / text).read_text()


@pytest.mark.parametrize("piece", ["online", "player", "plant"])
def test_a_firmware_can_pin_the_interface_at_compile_time(piece, circle_c, circle, tmp_path):
    if not shutil.which("gcc"):
        pytest.skip("gcc is missing: _Static_assert was not compiled")
    write_plant(circle.scenario, plant_of(circle.scenario), Real.FLOAT, tmp_path)
    name = "mems_hexapod_plant_f32" if piece == "plant" else getattr(circle_c, piece)[Real.FLOAT]
    source = circle.scenario.inputs["device"].path.read_bytes()
    right = {
        "ABI": f"{ABI}U",
        "DEVICE_HASH": f"0x{hashlib.sha256(source).hexdigest()[:8]}U",
        "RATE_HZ": "1000U",
        "DRIVE_SIZE": "6U",
    }
    right |= {
        "online": {"TARGET_SIZE": "6U", "STATE_SIZE": "6U", "DISPLACEMENT_SIZE": "6U"},
        "player": {"SAMPLES": "1000U", "SCENARIO_HASH": f"0x{circle.scenario.digest['scenario'][:8]}U"},
        "plant": {"MODEL_STATE_SIZE": "6U", "POSE_SIZE": "6U"},
    }[piece]

    def compiles(macro: str, value: str) -> bool:
        asserted = f'_Static_assert({name.upper()}_{macro} == {value}, "{macro}");'
        version = f"static const char version[] = {name.upper()}_VERSION; int main(void) {{ return version[0] == 0; }}"
        (tmp_path / "main.c").write_text(f'#include "{name}.h"\n{asserted}\n{version}\n')
        words = [
            "gcc",
            "-std=c11",
            "-Wall",
            "-Wextra",
            "-Werror",
            f"-I{circle_c.path}",
            f"-I{tmp_path}",
            "-fsyntax-only",
            "main.c",
        ]
        return subprocess.run(words, cwd=tmp_path, capture_output=True).returncode == 0

    for macro, value in right.items():
        assert compiles(macro, value), macro
        assert not compiles(macro, f"{value} + 1U"), macro


def test_a_rate_that_is_no_whole_number_stays_one():
    assert hertz(1 / (1 / 44100.0), Real.FLOAT) == "44100U" and hertz(None, Real.FLOAT) == "0U"
    assert hertz(0.25, Real.FLOAT) == "0.25f" and hertz(1000.5, Real.DOUBLE) == "1000.5"


def interface_of(text: str) -> str:
    """What of a header another program is compiled against: structures, functions, statuses and sizes, without comments, versions, hashes,
    the names of one build, and how long a device takes to settle."""
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    text = re.sub(r"#else\s+#if \(\w+_BUILD != .*?#endif", "", text, flags=re.DOTALL)  # another header of the name
    text = re.sub(r"#define \w+_(ABI|VERSION|DEVICE_HASH|SCENARIO_HASH|BUILD) .*", "", text)
    text = re.sub(r"(#define \w+_SETTLING) .*", r"\1", text)
    text = re.sub(r"_init_(with_)?[0-9_]+hz_[0-9a-f]{8}", "_init_build", text)
    return " ".join(text.split())


def test_the_number_of_the_interface_is_raised_with_the_interface():
    """The digest of the interface of the golden headers belongs to the number that they state."""
    golden = sorted((ROOT / "codegen" / "golden").glob("*/*_online_f32.h"))
    digest = hashlib.sha256("".join(interface_of(path.read_text()) for path in golden).encode()).hexdigest()[:16]
    path = ROOT / "tests" / "interface_digests.json"
    known = json.loads(path.read_text())
    assert max(map(int, known)) == ABI and known[str(ABI)] == digest, (
        "the interface of the generated C changed. Where code written for an older header, or a state that it compiled, no longer "
        f"fits: raise ABI in ctrlgen/firmware/c/templates.py, and write its number with {digest} into {path.name}; where something "
        "was only added: the digest"
    )
