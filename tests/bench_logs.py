"""Logs of the bench: 240 rows of one slow motion, 1 ms apart, as instruments and programs write them, beside what is true of each and what
is to be told."""

from __future__ import annotations

import datetime
import json
from dataclasses import dataclass

import numpy as np

N = 240
K = range(N)
T = np.round(1e-3 * np.arange(N), 6)  # s
U = np.round(np.sin(2 * np.pi * 7 * T) + 0.4 * np.sin(2 * np.pi * 17 * T), 4)  # V
X = np.round(50 * (U - 0.02 * np.cos(2 * np.pi * 7 * T)) + 0.3, 4)  # um
MS, NM = 1e3 * T, np.round(1e3 * X, 1)
HEAD = "t (s),u (V),x (um)\n"
LATE = datetime.datetime(2024, 3, 5, 23, 59, 59, 900_000)


@dataclass(frozen=True)
class Bench:
    """A log, and its time [s], drive [V] and reading [um], NaN where none was written; `told`: what stands in notes, questions, oddities or
    the refusal; whether it must be read without a question (`open_` False), may be asked, or must be refused (`refused`)."""

    text: str
    told: tuple[str, ...] = ()
    t: np.ndarray | None = None
    u: np.ndarray | None = None
    x: np.ndarray | None = None
    open_: bool = False
    refused: bool = False
    within: float = 2e-7
    encoding: str = "utf-8"


def rows(mark, *columns, tail="", decimal="."):
    def cell(c):
        return c if isinstance(c, str) else f"{c:.10g}".replace(".", decimal)

    return "".join(mark.join(map(cell, row)) + tail + "\n" for row in zip(*columns, strict=True))


def each(write):
    return "".join(write(k) + "\n" for k in K)


def csv(head, t=T, u=U, x=X):
    return head + rows(",", t, u, x)


def stamp(k, form="%H:%M:%S.%f", step=1e-3):
    text = (LATE + datetime.timedelta(seconds=step * k)).strftime(form)
    return text[:-3] if form.endswith("%f") else text


def lost(values, *places):
    out = values.copy()
    out[list(places)] = np.nan
    return out


def cells(values, **marks):
    """Texts of numbers, with those of `marks`, `_row=text`, in their rows."""
    at = {int(name[1:]): text for name, text in marks.items()}
    return [at.get(k, f"{v:.10g}") for k, v in enumerate(values)]


def read(text, *told, **true):
    return Bench(text, told, **true)


def asked(text, *told, **true):
    return Bench(text, told, open_=True, **true)


def refused(text, *told):
    return Bench(text, told, refused=True)


def segment(first, last):
    n, part = last - first, slice(first, last)
    head = f"Channels\t2\t\t\nSamples\t{n}\t{n}\t\nY_Unit_Label\tVolts\tum\t\nX0\t0.0\t0.0\t\nDelta_X\t0.001\t0.001\t\n"
    names = "***End_of_Header***\t\t\t\nX_Value\tdrive\tposition\tComment\n"
    return head + names + rows("\t", T[part], U[part], X[part]) + "\n"


LVM = "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\nX_Columns\tOne\n***End_of_Header***\t\n\t\n"
INFINIIUM = "Type:,AVERAGE\nPoints:,240\nXInc:,1.0E-03\nDate:,05 MAR 2024\nXUnits:,second\nYUnits:,Volt,um\n\nData:\n"
GCS = (
    "# REM E-712\n# SEPARATOR = 9\n# DIM = 3\n# SAMPLE_TIME = 1.0e-3\n# NDATA = 240\n# NAME0 = Target Position of Axis 1 [um]\n"
    "# NAME1 = Current Position of Axis 1 [um]\n# NAME2 = Control Voltage [V]\n# END_HEADER\n"
)
SCOPE = "Name\tScope\nFile\ta.tcscopex\n\n" + "".join(
    f"{k}\t{a}\t{k}\t{b}\n"
    for k, a, b in (
        ("Name", "Drive", "Pos"),
        ("Unit", "V", "mm"),
        ("SampleTime[ms]", "1", "1"),
        ("ScaleFactor", "1", "0.001"),
    )
)
DAYS_LATER = np.where(np.arange(N) < 100, 60.0 * np.arange(N), 60.0 * np.arange(N) + 2 * 86400)
HOURS_30 = 108_000.0 * np.arange(N)
GPS = 604_799_900 + np.arange(N)  # ms of the week
SPARSE = [k for k in K if k not in (50, 51, 52)]
UNPADDED = np.round(1000 * np.abs(X)).astype(int)
KEPT = X[np.arange(N) - np.arange(N) % 10]


def day(seconds, form):
    return (datetime.datetime(2024, 3, 5, 10) + datetime.timedelta(seconds=float(seconds))).strftime(form)


def turns(name, *sources, apart=0.0):
    """Rows of several sources in turn."""
    of = "".join(f"{s},{T[k] + j * apart:.4f},{U[k]},{X[k] / (j + 1):.4f}\n" for k in K for j, s in enumerate(sources))
    return f"{name},t (s),u (V),x (um)\n{of}"


# fmt: off
INSTRUMENTS = {
    "Infiniium": asked(INFINIIUM + rows(",", T - 0.12, U, X), "--time 0", "line 6 holds units"),
    "LeCroy with segments": refused(csv("Segments,2,SegmentSize,120\nTime,Drive (V),Pos (um)\n", np.r_[T[:120], T[:120]]),
                                    "another run", "rows = [0, 120], rows = [120, 240]"),
    "Siglent, two inputs in V": asked(csv("Vertical Units,CH1:V,CH2:V\nSource,CH1,CH2\nSecond,Volt,Volt\n"), "Free are CH2 [V]"),
    "PicoScope in German": read("Zeit;Kanal A;Kanal B\n(ms);(mV);(\u00b5m)\n\n" + rows(
        ";", MS, 1e3 * U, cells(X, _50="\u221e", _51="-\u221e")).replace(".", ","), "'\u221e' (first in line 54)", x=lost(X, 50, 51)),
    "peak detection in columns": asked("TIME,CH1 (V),CH2 Min (um),CH2 Max (um)\n" + rows(",", T, U, X - 0.05, X), "'CH2 Max (um)' as well"),
    "peak detection in pairs of rows": asked(csv("TIME,CH1 (V),CH2 (um)\n", np.repeat(T[::2], 2)), "2 rows of an instant", "keep one"),
    "LabVIEW in segments": read(LVM + segment(0, 120) + segment(120, 240), "its names stand again above line"),
    "DIAdem": read("Time;Drive;Weg\ns;V;\u00b5m\n" + rows(";", T, U, cells(X, _7="NoValue")).replace(".", ","), "'NoValue'", x=lost(X, 7)),
    "TwinCAT with a scale": asked(SCOPE + "\n" + rows("\t", MS, U, MS, X), "a scale for Pos", 'write unit = "um"'),
    "ACS": asked("Time(ms),RPOS(0),FPOS(0),PE(0)\n" + rows(",", MS, X - 0.1, X, 0.1 * T), "reading.axis = column 'FPOS(0)'"),
    "Aerotech": read("Time (ms)\tPosition Command (um)\tPosition Feedback (um)\tPosition Error (um)\tVoltage Command (V)\n"
                     + rows("\t", MS, X - 0.1 * T, X, 0.1 * T, U)),
    "set point, position and their difference in German": read(
        "Time [s];Sollwert [um];Istwert [um];Regelabweichung [um];Stellgr\u00f6\u00dfe [V]\n" + rows(";", T, X - T, X, T, U)),
    "GCS with a target": read(GCS + rows("\t", X - 0.1, X, U)),
    "a sampling period in cycles": asked("SamplePeriod\t10\tGatheringPeriod\t0.0001\nu [V]\tx [um]\n" + rows("\t", U, X),
                                         "SamplePeriod\\t10; GatheringPeriod\\t0.0001"),
    "SmarAct": read("#MCS2\nTime [us],Drive [mV],Position [pm]\n" + each(lambda k: f"{1000 * k},{1000 * U[k]:.1f},{round(1e6 * X[k])}")),
    "attocube": read("t_ns;u_V;x_pm;x_valid\n" + each(
        lambda k: f"{1709632800000000000 + 10**6 * k};{U[k]};{round(1e6 * X[k])};{int(k != 60)}"),
                     "x_valid: is 0 in 1 row and 1 in all others, not applied"),
    "a status in words": read("t (s),u (V),x (um),x status\n" + rows(",", T, U, X, cells(0 * T, _8="BAD")), "x status: is BAD in 1"),
    "encoder counts": asked("Time [s],Pos [cnt],Voltage [V]\n" + rows(",", T, np.round(10 * X), U), "Free are Pos [cnt]"),
    "SIOS": asked("SIOS Me\u00dftechnik\nMe\u00dffrequenz: 1000 Hz\n\nNr.\tL\u00e4nge / nm\tSpannung / V\n"
                  + each(lambda k: f"{k + 1}\t{1e3 * X[k]:.1f}\t{U[k]}".replace(".", ",")), "--rate 1000Hz"),
    "Micro-Epsilon": asked("Index;Zeit in \u00b5s;Abstand in mm;u in V\n" + rows(";", K, 1e6 * T, cells(1e-3 * X, _9="Fehler: zu nah"), U),
                           'missing = ["Fehler: zu nah"]'),
    "Keyence": read("DATE,TIME,OUT1(um),OUT2(V)\n" + each(
        lambda k: f"{stamp(k, '%Y/%m/%d')},{stamp(k)},{'+FFFFFF' if k == 20 else f'{X[k]:+010.4f}'},{U[k]:+08.4f}"), "'+FF", x=lost(X, 20)),
    "Zurich Instruments": read("% timebase: 210e6 Hz\n% Time / s; aux out / V; x / um\n" + rows(";", T, U, X)),
    "dBm": asked(csv("Time,Drive (V),Level (dBm)\n"), "its unit 'dBm' is not known"),
    "parts in ten of a unit": asked(csv("t (s),u (V),x [10 nm]\n", x=100 * X), "its unit '10 nm' is not known"),
    "a rate of a tenth": asked("Sample rate: 10 kHz\nDecimation: 10\nu [V],x [um]\n" + rows(",", U, X), "10 kHz; Decimation: 10"),
    "thousands in the rate": asked("Sample Rate: 1,000 Hz\nu [V],x [um]\n" + rows(",", U, X), "--rate 1000Hz"),
    "a rate in k": asked("Sample Rate: 1k\nu [V],x [um]\n" + rows(",", U, X), "--rate 1000Hz"),
    "frames": asked("fps: 60\nframe,u (V),x (um)\n" + rows(",", K, U, X), "--rate 60Hz"),
    "another rate beside the time": read(csv("Sample rate: 2 kHz\n" + HEAD), "its time goes on by 0.001 s"),
    "scaled end of 32 bits": read(csv(HEAD, x=cells(X, _30="2147483.647")), "far from all others", x=lost(X, 30)),
    "scaled end of 16 bits": read(csv(HEAD, x=cells(np.round(X, 1), _30="-3276.8")), "far from all others", x=lost(np.round(X, 1), 30)),
    "marks of Microsoft's library": read(csv(HEAD, x=cells(X, _4="1.#R", _5="-1.#J", _6="1.#QNB")), "'1.#QNB'", x=lost(X, 4, 5, 6)),
    "a reading held for ten rows": read(csv(HEAD, x=KEPT), "one row of 10 alone", x=KEPT),
    "hexadecimal counts": asked("t (s),u (V),adc\n" + each(
        lambda k: f"{T[k]},{U[k]},{round(100 * X[k]) & 0xFFFF:04X}"), "hexadecimal numbers"),
}

TIMES = {
    "milliseconds as siemens": read(csv("Time (mS),u (V),x (um)\n", MS)),
    "microseconds as siemens": read(csv("Time [uS],u (V),x (um)\n", 1e6 * T)),
    "msek": read("Zeit [msek];u [Volt];x [Mikrometer]\n" + rows(";", MS, U, X, decimal=",")),
    "modified Julian date": read("time (MJD),u (V),x (um)\n" + each(lambda k: f"{60374.4 + T[k] / 86400:.12f},{U[k]},{X[k]}"), within=2e-6),
    "GPS time over the week's end": read("TOW (s),u (V),x (um)\n" + each(
        lambda k: f"{GPS[k] % 604_800_000 / 1000:.3f},{U[k]},{X[k]}"), "counts to 604800 and begins again"),
    "a fraction of the day": asked("Time,u (V),x (um)\n" + each(lambda k: f"{0.4166666667 + T[k] / 86400:.12f},{U[k]},{X[k]}"),
                                   "day is assumed, 0.001 s"),
    "days from zero": asked("Time,u (V),x (um)\n" + each(lambda k: f"{T[k] / 86400:.6E},{U[k]},{X[k]}"), "day is assumed, 0.001 s"),
    "hours from zero": asked("Time,u (V),x (um)\n" + each(lambda k: f"{T[k] / 360:.9f},{U[k]},{X[k]}"), "h is assumed, 0.01 s"),
    "date and time of day, days between": read("Date,Time,u (V),x (um)\n" + each(
        lambda k: f"{day(DAYS_LATER[k], '%Y-%m-%d,%H:%M:%S')},{U[k]},{X[k]}"), "read as one time", t=DAYS_LATER),
    "date and time of day, 30 h apart": read("Date;Time;u (V);x (um)\n" + each(
        lambda k: f"{day(HOURS_30[k], '%d.%m.%Y;%H:%M:%S')};{U[k]};{X[k]}"), "read as one time", t=HOURS_30),
    "time of day before its date": read("Uhrzeit;Datum;u [V];x [um]\n" + each(
        lambda k: f"{stamp(k)};{stamp(k, '%d.%m.%Y')};{U[k]};{X[k]}"), "read as one time"),
    "frames of a time code": asked("Timecode,u (V),x (um)\n" + each(lambda k: f"10:00:{k // 25:02d}:{k % 25:02d},{U[k]},{X[k]}"),
                                   "(column 'Timecode' holds '10:00:00:00', whose last part is no thousandths"),
    "switched on again": asked("ms since boot,u (V),x (um)\n" + each(lambda k: f"{5000 + k if k < 130 else k - 127},{U[k]},{X[k]}"),
                               "falls in 1 row, first after row 129"),
    "milliseconds without zeros": refused("Time,u (V),x (um)\n" + each(
        lambda k: f"10:00:00.{k},{U[k]},{X[k]}"), "rather '10:00:00.001'", "%03d"),
    "microseconds without zeros": refused("time,u (V),x (um)\n" + each(
        lambda k: f"{100 + (95 + k) // 1000}.{(95 + k) % 1000 * 1000},{U[k]},{X[k]}"), "as '%d.%d' prints", "%06d"),
    "readings without zeros": refused(HEAD + each(
        lambda k: f"{T[k]},{U[k]},{UNPADDED[k] // 1000}.{UNPADDED[k] % 1000}"), "as '%d.%d' prints"),
    "durations of Go": asked("elapsed,u (V),x (um)\n" + each(lambda k: f"{k}.5ms,{U[k]},{X[k]}" if k < 200 else f"0.{k}s,{U[k]},{X[k]}"),
                             "'0.5ms', which is no time that is read; write seconds"),
    "a zone by its name": asked("time,u (V),x (um)\n" + each(lambda k: f"2024-03-05T10:00:00.{k:03d}+01:00[Europe/Berlin],{U[k]},{X[k]}"),
                                "write them as ISO 8601"),
    "rows lost, told by their number": asked("Sample rate: 1000 Hz\nseq,u (V),x (um)\n" + "".join(f"{k},{U[k]},{X[k]}\n" for k in SPARSE),
                                             "3 numbers are left out, the first after row 49", "--time seq --unit seq=1ms",
                                             u=U[SPARSE], x=X[SPARSE]),
    "axes in turn, of one instant": refused(turns("axis", "A", "B"), "several sources in turn: column 'axis' goes through A, B"),
    "axes in turn, one after the other": refused(turns("ch", 0, 1, apart=5e-4), "column 'ch' goes through 0, 1"),
    "sensors in turn": refused(turns("sensor no", 1, 2, 3), "column 'sensor no' goes through 1, 2, 3"),
}

TEXTS = {
    "ESP32": read(each(lambda k: f"\x1b[0;32mI ({12345 + k}) stage: u={U[k]}V x={X[k]}um\x1b[0m"), "the time before them as 'time'"),
    "units in rows of JSON": read("".join(json.dumps({
        "ts": 1709632800000 + k, "u": {"value": U[k], "unit": "V"}, "x": {"value": X[k], "unit": "um"}}) + "\n" for k in K)),
    "units in columns": read("t,t unit,u,u unit,x,unit\n" + each(lambda k: f"{k},ms,{U[k]},V,{NM[k]},nm"), "x: unit says nm", x=NM / 1e3),
    "Excel in Switzerland": read("Zeit [ms];u [V];Weg [nm]\n" + each(
        lambda k: f"{k};{U[k]};{NM[k]:,.1f}".replace(",", "\u2019")), x=NM / 1e3),
    "Excel in France": read("Temps (ms);Tension (V);x (nm)\n" + each(
        lambda k: f"{k};{U[k]};{NM[k]:,.1f}".replace(",", "\u202f").replace(".", ",")), "blanks between thousands", x=NM / 1e3),
    "texts of a spreadsheet": read(HEAD + each(lambda k: f"'{T[k]},'{U[k]},'{X[k]}"), "numbers such as"),
    "formulas of texts": read(HEAD + each(lambda k: f'="{T[k]}",="{U[k]}",="{X[k]}"'), "numbers such as"),
    "scalars of NumPy": read(HEAD + each(lambda k: f"{T[k]},np.float64({U[k]}),np.float64({X[k]})"), "'np.float64(0.0)'"),
    "floats of C": read(HEAD + each(lambda k: f"{T[k]},{U[k]}f,{X[k]}f"), "numbers such as '0.0f' are read as 0.0"),
    "pages": read(each(lambda k: ("\nPage\nt (s)  u (V)  x (um)\n" if k % 60 == 0 else "") + f"{T[k]:7.3f} {U[k]:8.4f} {X[k]:9.4f}"),
                  "its names stand again above lines 67, 130, 193"),
    "runs under one another": refused(csv(HEAD) + csv(HEAD), "holds 2 tables"),
    "a footer": read(csv(HEAD) + "# end\nMin,-2,-70\nEND\n", "line 243, below the table"),
    "text in UTF-8 twice": read("Zeit [ms];u [V];x [\u00c2\u00b5m]\n" + rows(";", MS, U, X)),
    "two units of a column": read(csv("t [s],u [V],Weg [mm]\ns,V,um\n"), "its name says mm, line 2 says um, which is taken"),
    "units in front": read(csv("[ms] time,[V] drive,[um] pos\n", MS)),
    "units in Chinese": read(csv("\u65f6\u95f4(\u6beb\u79d2),\u7535\u538b(V),\u4f4d\u79fb(\u5fae\u7c73)\n", MS)),
    "null characters": refused(HEAD + rows(",", T[:9], U[:9], X[:9]) + "\0" * 99 + "\n" + csv(""), "99 null characters in line 11"),
    "a list of columns": read("# 1: t [s]\n# 2: u [V]\n# 3: x [um]\n" + rows(" ", T, U, X), "the header lists"),
    "another list of columns": read("Column 1: t (ms)\nColumn 2: u (V)\nColumn 3: x (um)\n\n" + rows("\t", MS, U, X), "the header lists"),
    "remarks of BASIC": read("REM stage log\nREM t(s) u(V) x(um)\n" + rows(" ", T, U, X)),
    "remarks of SPICE": read("* stage log\n* t(s) u(V) x(um)\n" + rows(" ", T, U, X)),
    "xmgrace": asked('@    xaxis  label "t (s)"\n@ s0 legend "u (V)"\n@TYPE nxy\n' + rows(" ", T, U, X), "--time 0"),
    "a variable of MATLAB": asked("data = [\n" + rows(" ", T, U, X, tail=";") + "];\n", "drive.axis = column '0'", u=T, x=U),
    "a rule under the units": read(csv("TIME,DRIVE,POSITION\ns,V,um\n----,----,----\n")),
    "tabs and commas": read("t (s),\tu (V),\tx (um)\n" + rows(",\t", T, U, X)),
    "a blank cell of a fixed width": refused("  t(s)  u(V)  x(um)\n" + each(
        lambda k: f"{T[k]:9.3f} {'' if k == 50 else f'{U[k]:.4f}':>9} {X[k]:9.4f}"), "line 52 has 2"),
}
# fmt: on
BENCH = {**INSTRUMENTS, **TIMES, **TEXTS}
