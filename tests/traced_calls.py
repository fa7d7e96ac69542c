"""A program that calls all of a generated package with targets of every kind and prints the bits of what it answers: the same C on two
machines, or under two sets of options, is compared line by line."""

from __future__ import annotations

import re
import struct

from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.folder import CFolder

HEAD = """
#include <stdint.h>
#include <stdio.h>
#include <string.h>

typedef {real} real;
static uint32_t seed = 20077U;

/* A number of 0 ... below - 1; the same on every machine. */
static uint32_t drawn(uint32_t below)
{{
    seed = (seed * 1664525U) + 1013904223U;
    return (seed >> 8U) % below;
}}

static void put(const char *what, uint32_t status, const real *values, unsigned count)
{{
    unsigned k;
    (void)printf("%s %lx", what, (unsigned long)status);
    for (k = 0U; k < count; k++) {{
        {word} bits;
        (void)memcpy(&bits, &values[k], sizeof bits);
        (void)printf(" {format}", {printed});
    }}
    (void)printf("\\n");
}}

/* No number, or one that no device has. */
static real spoilt(void)
{{
    static const {word} BITS[] = {{ {spoilt} }};
    real value;
    (void)memcpy(&value, &BITS[drawn({spoilt_count}U)], sizeof value);
    return value;
}}

/* A number off one of the vectors, by up to an eighth of it. */
static real near(real value)
{{
    volatile real share = ((real)drawn(1U << 16U) - (real)32768) / (real)262144;
    volatile real moved = value * share;
    volatile real sum = value + moved;
    return sum;
}}

static void take(const real *vector, real *target, unsigned count, unsigned how)
{{
    unsigned k;
    for (k = 0U; k < count; k++) {{
        target[k] = (how == 0U) ? vector[k] : near(vector[k]);
    }}
    if (how == 3U) {{
        const uint32_t which = drawn(count);
        target[which] = spoilt();
    }}
}}
"""
# NaN of both kinds and signs, infinities, the least and the largest numbers, denormal ones, a negative zero
SPOILT = {
    Real.FLOAT: "0x7FC00000U, 0xFFC00001U, 0x7F800001U, 0x7F800000U, 0xFF800000U, 0x7F7FFFFFU, 0xFF7FFFFFU, 1U, 0x80000001U, 0x007FFFFFU, "
    "0x80000000U",
    Real.DOUBLE: "0x7FF8000000000000U, 0xFFF8000000000001U, 0x7FF0000000000001U, 0x7FF0000000000000U, 0xFFF0000000000000U, "
    "0x7FEFFFFFFFFFFFFFU, 0xFFEFFFFFFFFFFFFFU, 1U, 0x8000000000000001U, 0x000FFFFFFFFFFFFFU, 0x8000000000000000U",
}
ONLINE = """
static void {name}_called(void)
{{
    static {name}_state state;
    static {online}_output out;
    real target[{U}_TARGET_SIZE];
    uint32_t k;
    uint32_t tick = 0xFFFFFF00U;
    {name}_init(&state);
    (void)memset(&out, 0, sizeof out);
    for (k = 0U; k < {calls}U; k++) {{
        const uint32_t call = drawn(16U);
        const uint32_t vector = drawn((uint32_t){V}_COUNT);
        const uint32_t how = drawn(4U);
        uint32_t status = 0U;
        take({vectors}_target[vector], target, {U}_TARGET_SIZE, how);
        if (call == 0U) {{
            status = {name}_settle(&state, target, &out);
{functions}
        }} else {{
            status = {name}_{step}(&state, target, &out);
        }}
        put("{name}", status, out.drive, {U}_DRIVE_SIZE);
        put("{name} at", status, out.displacement, {U}_DISPLACEMENT_SIZE);
        if ((drawn(32U) == 0U) || ((status & {U}_LOST) != 0U)) {{
            {name}_init(&state);
        }}
    }}
    (void)tick;
}}
"""
FUNCTIONS = {
    "step_at": """
        }} else if (call < 4U) {{
            tick += (drawn(8U) != 0U) ? 1U : (drawn(200U) - 5U);
            status = {name}_step_at(&state, tick, target, &out);""",
    "forget": """
        }} else if ((call == 4U) && (drawn(4U) == 0U)) {{
            status = {name}_forget(&state);""",
    "elapsed": """
        }} else if (call == 5U) {{
            status = {name}_elapsed(&state, drawn(90U), out.drive);""",
    "step_after": """
        }} else if (call < 9U) {{
            status = {name}_step_after(&state, (real)1 / (real)1024, (real)(1U + drawn(2U)) / (real)1024, target, &out);""",
}
PLAYER = """
static void {name}_called(void)
{{
    real drive[{U}_DRIVE_SIZE] = {{ 0 }};
    uint32_t k;
    for (k = 0U; k < {calls}U; k++) {{
        static const uint32_t FAR[] = {{ 0xFFFFFFFFU, 0x80000000U, 0x7FFFFFFFU, {U}_SAMPLES, {U}_SAMPLES - 1U }};
        const uint32_t index = (drawn(8U) == 0U) ? FAR[drawn(5U)] : drawn({U}_SAMPLES * 2U);
        uint32_t status = {name}_sample(index, drive);
        put("{name}", status, drive, {U}_DRIVE_SIZE);
        (void)printf("next %lu\\n", (unsigned long){name}_next(index));
{at}
    }}
}}
"""
AT = """        {{
            const real time = (drawn(8U) == 0U) ? spoilt() : ((real)drawn({U}_SAMPLES * 2U) + (real)0.25) / (real)({U}_RATE_HZ);
            status = {name}_at(time, drive);
            put("{name} at", status, drive, {U}_DRIVE_SIZE);
        }}"""
MAIN = """
int main(void)
{{
    {selftest}_result outcome;
    const int wrong = {selftest}(&outcome);
    (void)printf("%d of %d vectors are wrong\\n", wrong, outcome.compared);
{calls}
    return (wrong == 0) ? 0 : 1;
}}
"""

# Starts that program on a board of QEMU, with newlib's semihosting
BOARD = """#include <stdlib.h>
extern unsigned int stack_top[];
extern void initialise_monitor_handles(void);
extern int main(void);
void reset(void);
void _init(void);
void _fini(void);
void _init(void) {}
void _fini(void) {}
static void fault(void) { _Exit(99); }
__attribute__((section(".vectors"), used)) static void *const VECTORS[16] = {
    stack_top, (void *)reset, (void *)fault, (void *)fault, (void *)fault, (void *)fault, (void *)fault
};
void reset(void)
{
#if defined(__ARM_FP)
    *(volatile unsigned int *)0xE000ED88U |= 0xF00000U;
    __asm__ volatile("dsb\\n\\tisb");
#endif
    initialise_monitor_handles();
    exit(main());
}
"""


def program(folder: CFolder, real: Real, calls: int = 400) -> str:
    """The program, C99 and C++ alike: its self test, then that many `calls` of each controller and of the player."""
    online, double = folder.online[real], real is Real.DOUBLE
    names = [name for name in (online, folder.checked.get(real)) if name]
    player = folder.player.get(real)
    headers = [*names, *([player] if player else []), folder.vectors[real], folder.selftest[real]]
    text = "".join(f'#include "{name}.h"\n' for name in headers)
    text += HEAD.format(
        real=real.value,
        word="uint64_t" if double else "uint32_t",
        format="%08lx%08lx" if double else "%08lx",
        printed="(unsigned long)(bits >> 32U), (unsigned long)(bits & 0xFFFFFFFFU)"
        if double
        else "(unsigned long)bits",
        spoilt=SPOILT[real],
        spoilt_count=SPOILT[real].count(",") + 1,
    )
    words = {"online": online, "vectors": folder.vectors[real], "V": folder.vectors[real].upper(), "calls": calls}
    for name in names:
        header = (folder.path / f"{name}.h").read_text()
        has = {key for key in (*FUNCTIONS, "step") if re.search(rf"\b{name}_{key}\(", header)}
        own = words | {"name": name, "U": online.upper(), "step": "step" if "step" in has else "settle"}
        text += ONLINE.format(**own, functions="".join(FUNCTIONS[key] for key in FUNCTIONS if key in has).format(**own))
    if player:
        own = words | {"name": player, "U": player.upper()}
        timed = f"{player}_at(" in (folder.path / f"{player}.h").read_text()
        text += PLAYER.format(**own, at=AT.format(**own) if timed else "        (void)status;")
    called = "".join(f"    {name}_called();\n" for name in (*names, *([player] if player else [])))
    return text + MAIN.format(selftest=folder.selftest[real], calls=called)


def numbers(line: str, real: Real) -> tuple[str, list[float]]:
    """Of a line what was called with its status, and the numbers that came back."""
    words = line.split(" ")
    digits = 16 if real is Real.DOUBLE else 8
    found = [word for word in words if len(word) == digits and re.fullmatch("[0-9a-f]+", word)]
    code = ">d" if real is Real.DOUBLE else ">f"
    return " ".join(words[: len(words) - len(found)]), [struct.unpack(code, bytes.fromhex(word))[0] for word in found]
