"""What the emulated cores count and compare is right, and what is wrong with a program is found."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace

import numpy as np
import pytest
from conftest import SCENARIOS

from ctrlgen import ToolError, build_model, generate, load_scenario, solve
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.folder import CFolder
from ctrlgen.verification import cores, emulation, in_loop
from ctrlgen.verification.build_record import BUDGETS
from ctrlgen.verification.cores import CORES, M0_PLUS, M4F, RV32IMC, cross_compile, cross_compilers
from ctrlgen.verification.emulated_target import NotRun
from ctrlgen.verification.emulation import Machine, available
from ctrlgen.verification.in_loop import InLoop, run_in_loop
from ctrlgen.verification.qemu import check_on_boards
from ctrlgen.verification.reference import ReferenceAnswers

pytestmark = pytest.mark.long

# each r0 <- (r0 + 1) + 2 + ... + n style loop is written out, so that what it executes is known
KNOWN = """
__attribute__((naked, noinline)) int known(int count)
{
    __asm__ volatile(
        "mov r1, #0\\n"            /* 1 */
        "1: add r1, r1, r0\\n"     /* 3 a round */
        "subs r0, r0, #1\\n"
        "bne 1b\\n"
        "movw r2, #0x1234\\n"      /* one of four bytes */
        "cmp r1, #0\\n"
        "it eq\\n"                 /* skipped instructions count */
        "moveq r1, #7\\n"
        "mov r0, r1\\n"
        "bx lr\\n");
}
__attribute__((naked, noinline)) int deep(void)
{
    __asm__ volatile("sub sp, sp, #160\\n mov r0, #1\\n str r0, [sp]\\n add sp, sp, #160\\n bx lr\\n");
}
int spin(void) { for (;;) { __asm__ volatile(""); } }
int astray(void) { return *(volatile int *)0x60000000; }
float half(const float *x, float *y) { *y = 0.5f * *x; return 0; }
static int remembered;
int keeps(void) { remembered++; return remembered; }
int all(void) { return known(1) + deep() + spin() + astray() + keeps(); }
"""


# the same without IT, which ARMv6-M has not, and for RISC-V, with an instruction of two bytes and one of four in each round
PLAIN = """
__attribute__((naked, noinline)) int known(int count)
{
    __asm__ volatile(
        ".syntax unified\\n"
        "movs r1, #0\\n"           /* 1 */
        "1: adds r1, r1, r0\\n"    /* 3 a round */
        "subs r0, r0, #1\\n"
        "bne 1b\\n"
        "mov r0, r1\\n"
        "bx lr\\n");
}
"""
REDUCED = """
__attribute__((naked, noinline)) int known(int count)
{
    __asm__ volatile(
        "li a1, 0\\n"              /* 1 */
        "1: c.add a1, a0\\n"       /* 3 a round */
        ".option push\\n.option norvc\\n"
        "addi a0, a0, -1\\n"
        ".option pop\\n"
        "bnez a0, 1b\\n"
        "mv a0, a1\\n"
        "ret\\n");
}
"""


@pytest.fixture(params=["zig", "arm-none-eabi-gcc"])
def cross(request) -> str:
    if not available():
        pytest.skip(f"nothing emulates: {emulation.MISSING}")
    if request.param not in cross_compilers():
        pytest.skip(f"{request.param} is missing: {cores.INSTALL[request.param]}")
    return request.param


@pytest.fixture
def machine(cross, tmp_path) -> Machine:
    """A Cortex-M4F with a program whose costs are known."""
    (tmp_path / "known.c").write_text(KNOWN)
    program = tmp_path / "known.elf"
    cross_compile(cross, M4F, [tmp_path / "known.c"], tmp_path, "all", program)
    return Machine(M4F, program)


@pytest.mark.parametrize("rounds", [1, 2, 17])
def test_instructions_are_counted_exactly(machine, rounds):
    returned, count = machine.call("known", rounds)
    assert returned == rounds * (rounds + 1) // 2
    assert count == 1 + 3 * rounds + 6


@pytest.mark.parametrize(("core", "text"), [(M0_PLUS, PLAIN), (RV32IMC, REDUCED)], ids=["Cortex-M0+", "RV32IMC"])
def test_cores_without_an_fpu_count_exactly_and_divide_by_software(core, text, tmp_path):
    """A quotient needs the compiler's own arithmetic, and data whose place RISC-V knows by a register."""
    present = [name for name in core.compilers if name in cross_compilers()]
    if not available() or not present:
        pytest.skip(f"{emulation.MISSING}; {'; '.join(cores.INSTALL[name] for name in core.compilers)}")
    text += "static float third = 3.0f;\nfloat *place(void) { return &third; }\n"
    text += "float by(const float *x, float *y) { *y = *x / third; return 0; }\n"
    text += "int all(void) { float y = 1.0f; return known(1) + (int)by(&y, place()); }\n"
    (tmp_path / "known.c").write_text(text)
    for compiler in present:
        program = tmp_path / f"{compiler}.elf"
        cross_compile(compiler, core, [tmp_path / "known.c"], tmp_path, "all", program)
        machine = Machine(core, program)
        for rounds in (1, 2, 17):
            assert machine.call("known", rounds) == (rounds * (rounds + 1) // 2, 1 + 3 * rounds + 2)
        x, y = machine.reserve(1, Real.FLOAT), machine.reserve(1, Real.FLOAT)
        machine.write(x, np.array([np.pi]), Real.FLOAT)
        machine.call("by", x, y)
        assert machine.read(y, 1, Real.FLOAT)[0] == np.float32(np.pi) / np.float32(3)
        assert machine.code < 4096  # of the compiler's arithmetic only what is called


def test_stack_is_what_the_deepest_call_touched(machine):
    machine.call("known", 3)
    assert machine.stack == 0
    machine.call("deep")
    machine.call("known", 3)
    assert machine.stack == 160


def test_numbers_pass_through_memory_unchanged(machine):
    x, y = machine.reserve(1, Real.FLOAT), machine.reserve(1, Real.FLOAT)
    machine.write(x, np.array([np.pi]), Real.FLOAT)
    machine.call("half", x, y)
    assert machine.read(y, 1, Real.FLOAT)[0] == np.float32(0.5) * np.float32(np.pi)


def test_writable_memory_is_seen(machine):
    assert machine.writable == 4


def test_a_call_that_does_not_return_is_stopped_and_named(machine, monkeypatch):
    monkeypatch.setattr(emulation, "MOST", 100_000)
    with pytest.raises(ToolError, match="spin did not return within"):
        machine.call("spin")


def test_a_fault_is_reported_with_function_and_place(machine):
    with pytest.raises(ToolError, match="stopped in astray at 0x"):
        machine.call("astray")
    assert machine.call("known", 2)[0] == 3  # the core goes on


def test_c_that_is_no_c_is_refused_with_the_compilers_words(cross, tmp_path):
    (tmp_path / "bad.c").write_text("int f(void) { return nothing; }\n")
    with pytest.raises(ToolError, match=r"refuses the C for Cortex-M4F(.|\n)*nothing"):
        cross_compile(cross, M4F, [tmp_path / "bad.c"], tmp_path, "f", tmp_path / "bad.elf")


@pytest.fixture(scope="module")
def reference(circle) -> ReferenceAnswers:
    return ReferenceAnswers(circle)


@pytest.fixture(scope="module")
def folder(circle, tmp_path_factory) -> CFolder:
    return generate(circle.scenario, circle.model, tmp_path_factory.mktemp("c"), circle)


def test_counting_by_block_is_counting_every_instruction(cross, folder, reference, tmp_path):
    """The blocks' sum against a hook called for each instruction, over targets within and beyond the limits."""
    import unicorn

    class Single:
        """Counts instruction by instruction; the hook is not called for those an IT skips, so an IT counts all it guards."""

        def __init__(self) -> None:
            self.count, self.guarded = 0, set()

        def __call__(self, uc, address: int, size: int, _: object) -> None:
            if address in self.guarded:
                return
            self.count, self.guarded = self.count + 1, set()
            word = int.from_bytes(uc.mem_read(address, 2), "little")
            if word & 0xFF00 == 0xBF00 and word & 0xF:
                at = address + 2
                for _ in range(4 - (word & 0xF & -(word & 0xF)).bit_length() + 1):
                    self.guarded.add(at)
                    at += 4 if int.from_bytes(uc.mem_read(at, 2), "little") >= 0xE800 else 2
                self.count += len(self.guarded)

    name = folder.online[Real.FLOAT]
    program = tmp_path / "online.elf"
    cross_compile(cross, M4F, [folder.path / f"{name}.c"], folder.path, folder.init[Real.FLOAT], program)
    machine = Machine(M4F, program)
    single = Single()
    machine.emulator.hook_add(unicorn.UC_HOOK_CODE, single)
    state, target, out = (machine.reserve(count, Real.FLOAT) for count in (13, 6, 18))
    machine.call(folder.init[Real.FLOAT], state)
    counts = []
    for wanted in [*reference.command[:5], *reference.random[-15:]]:
        machine.write(target, wanted, Real.FLOAT)
        single.count = 0
        counts.append(machine.call(f"{name}_step", state, target, out)[1])
        assert counts[-1] == single.count
    assert len(set(counts)) > 2


@pytest.fixture(scope="module")
def ran(compiler, folder, reference) -> InLoop:
    if not available() or not cross_compilers():
        pytest.skip(f"nothing emulates: {emulation.MISSING} ziglang")
    return run_in_loop(folder, reference)


@pytest.mark.long
def test_every_target_answers_with_this_computers_bits(ran):
    assert ran.passed and not ran.stopped
    assert len(ran.runs) == sum(len(core.reals) * len(set(core.compilers) & set(cross_compilers())) for core in CORES)
    assert {run.core for run in ran.runs} == {core.name for core in CORES}
    for run in ran.runs:
        assert run.numbers > (30_000 if run.core in ("Cortex-M4F", "Cortex-M7") else 6_000)
        assert run.differing == 0 and run.writable == 0, run.where


@pytest.mark.long
def test_the_circle_costs_what_the_project_promises_on_a_cortex_m4f(ran):
    runs = [run for run in ran.runs if run.core == "Cortex-M4F"]
    assert runs
    for run in runs:
        for kind, budget in BUDGETS.items():
            assert 0 < run.instructions[kind] <= budget
        assert 0 < run.stack < 4096 and 0 < run.tables < run.code


def only(monkeypatch, core=M4F, real: Real = Real.FLOAT) -> None:
    """One run instead of six."""
    compiler = next((name for name in core.compilers if name in cross_compilers()), None)
    if not available() or compiler is None:
        pytest.skip(f"nothing emulates: {emulation.MISSING} ziglang")
    found = {compiler: cross_compilers()[compiler]}
    monkeypatch.setattr(in_loop, "cross_compilers", lambda: found)
    monkeypatch.setattr(in_loop, "CORES", (replace(core, reals=(real,)),))
    monkeypatch.setattr(in_loop, "RANDOM", 20)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A stage of three axes, its reference and its C."""
    scenario = load_scenario(SCENARIOS / "rrr_circle")
    solution = solve(scenario, build_model(scenario.device))
    return ReferenceAnswers(solution), generate(scenario, solution.model, tmp_path_factory.mktemp("rrr"), solution)


def spoiled(c: CFolder, into, old: str, new: str, real: Real = Real.FLOAT) -> CFolder:
    """A copy of the C with one text of its online controller replaced."""
    shutil.copytree(c.path, into)
    path = into / f"{c.online[real]}.c"
    text, count = re.subn(old, new, path.read_text(), count=1)
    assert count == 1, old
    path.write_text(text)
    return replace(c, path=into)


def spoil_on_target(c: CFolder, into, old: str, new: str) -> CFolder:
    """The same, but only where the C is compiled for a Cortex: what a wrong compiler or library would do."""
    return spoiled(c, into, old, rf"\n#ifdef __arm__\n{new}\n#else\n\g<0>\n#endif\n")


def test_a_small_stage_runs_bit_for_bit(small, compiler, monkeypatch):
    only(monkeypatch)
    reference, c = small
    (run,) = run_in_loop(c, reference).runs
    assert run.passed and run.differing == 0 and run.ulp == 0 and run.where == ""


def test_a_double_constant_in_float_code_costs_more_and_changes_bits(small, compiler, monkeypatch, tmp_path):
    only(monkeypatch)
    reference, c = small
    (plain,) = run_in_loop(c, reference).runs
    old = r"    uint32_t status = 0U;\n    int limited = 0;"
    bad = spoil_on_target(
        c,
        tmp_path / "c",
        old,
        "    uint32_t status = 0U;\n    int limited = 0;\n"
        "    out->displacement[0] = (float)(out->displacement[0] * 1.0000001);",
    )
    found = run_in_loop(bad, reference)
    if found.runs:  # zig links a library for double
        (run,) = found.runs
        assert run.differing > 0 and run.ulp > 0 and run.where and not run.passed and not found.passed
        assert run.instructions["scenario"] > plain.instructions["scenario"] + 20
    else:  # a compiler without such a library refuses to link
        assert "refuses the C" in found.stopped[0].words and not found.passed


def test_a_call_that_hangs_on_the_target_is_stopped_and_reported(small, compiler, monkeypatch, tmp_path):
    only(monkeypatch)
    monkeypatch.setattr(emulation, "MOST", 100_000)
    reference, c = small
    bad = spoil_on_target(
        c, tmp_path / "c", r"    int hit = 0;", '    int hit = 0;\n    for (;;) { __asm__ volatile(""); }'
    )
    found = run_in_loop(bad, reference)
    assert not found.passed and not found.runs
    assert "did not return" in found.stopped[0].words and found.stopped[0].core == "Cortex-M4F"


def test_memory_of_its_own_fails_a_run(small, compiler, monkeypatch, tmp_path):
    only(monkeypatch)
    reference, c = small
    bad = spoiled(
        c,
        tmp_path / "c",
        r"    uint32_t status = 0U;\n",
        "    uint32_t status = 0U;\n    static volatile int calls;\n    calls++;\n",
    )
    (run,) = run_in_loop(bad, reference).runs
    assert run.writable == 4 and run.differing == 0 and not run.passed


def test_without_an_emulator_nothing_ran_and_the_remedy_is_named(small, monkeypatch):
    monkeypatch.setattr(in_loop, "available", lambda: False)
    found = run_in_loop(small[1], small[0])
    assert found.runs == () and found.not_run == (
        NotRun(what="emulated cores", remedy="pip install unicorn pyelftools"),
    )


def test_without_cross_compilers_each_is_named_with_its_remedy(small, compiler, monkeypatch):
    monkeypatch.setattr(in_loop, "available", lambda: True)
    monkeypatch.setattr(cores.importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(cores.shutil, "which", lambda name: None)
    found = run_in_loop(small[1], small[0])
    assert found.runs == () and {row.what: row.remedy for row in found.not_run} == {
        "zig": "pip install ziglang",
        "arm-none-eabi-gcc": "apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi",
        "riscv64-unknown-elf-gcc": "apt-get install gcc-riscv64-unknown-elf",
    }


@pytest.fixture
def boards() -> None:
    for tool in ("arm-none-eabi-gcc", "qemu-system-arm"):
        if not shutil.which(tool):
            pytest.skip(f"{tool} is missing: apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm")


def test_the_vectors_agree_on_every_board(boards, small):
    checks = check_on_boards(small[1])
    assert len(checks) == 4
    for check in checks:
        assert check.passed and re.search(r"^(\d+) of \1 reference vectors agree$", check.note)


def test_a_spoiled_vector_fails_on_the_boards_of_its_arithmetic(boards, small, tmp_path):
    shutil.copytree(small[1].path, tmp_path / "c")
    c = replace(small[1], path=tmp_path / "c")
    path = c.path / f"{c.vectors[Real.FLOAT]}.c"
    text, count = re.subn(r"(_status\[\d+\] = \{\s*0U, )0U", r"\g<1>8U", path.read_text(), count=1)
    assert count == 1
    path.write_text(text)
    states = {(check.tool, check.subjects[0][1]): check for check in check_on_boards(c)}
    for (_, real), check in states.items():
        assert check.state == ("failed" if real is Real.FLOAT else "passed")
        if real is Real.FLOAT:
            assert "1 of" in check.findings[0].text and "disagree" in check.findings[0].text


def test_without_qemu_the_boards_did_not_run(small, monkeypatch):
    monkeypatch.setenv("PATH", "")
    (check,) = check_on_boards(small[1])
    assert check.state == "not run" and "apt-get install qemu-system-arm" in check.note
