"""Short logs of programs beyond those of `logger_files`: the same drive and reading, 60 rows 1 ms apart, as each program writes them."""

from __future__ import annotations

import json

from logger_files import N, T, U, X, rows

K = range(N)


def lines(head: str, write) -> str:
    return head + "".join(write(k) + "\n" for k in K)


def clock(k: int, mark: str = ",") -> str:
    return f"10:00:00{mark}{k:03d}"


def stepped(k: int) -> str:
    """A byte string of CAN in hexadecimal, which may look like decimal numbers."""
    return " ".join(f"{(3 * k + j) % 10:02d}" for j in range(8))


TOA5 = (
    '"TOA5","CR6","CR6","1234","CR6.Std.11","CPU:a.CR6","4711","a"\n"TIMESTAMP","RECORD","u","x"\n'
    '"TS","RN","Volts","um"\n"","","Smp","Avg"\n'
)
GL840 = (
    'Vendor,Graphtec Corporation\nAMP settings\nCH,Signal name,Input,Range,Filter,Span\nCH1,"u",DC,5V,Off,5.0,-5.0,V\nData\n'
    "Number,Date&Time,ms,u,x,Alarm1\nNO.,Time,ms,V,um,A12345678901234\n"
)
CATMAN = (
    "HBM_CATMAN_DATAFILE_40\t3\nT0:\t05.03.2024 10:00:00\nKan\u00e4le\t3\n\nZeit\tu\tx\ns\tV\t\u00b5m\nGain\t1\t1\n"
    "1000 Hz\t1000 Hz\t1000 Hz\n"
)
READ = {  # program: its file; the columns of the drive and of the reading are u and x where no others are named
    "logging of Python": lines(
        "2024-03-05 09:59:59,000 INFO started\n", lambda k: f"2024-03-05 {clock(k)} INFO x={X[k]} u={U[k]}"
    ),
    "logging with a module": lines("", lambda k: f"2024-03-05 {clock(k)} [INFO] a.loop: u={U[k]}, x={X[k]}"),
    "logging of JSON": lines(
        "", lambda k: f"2024-03-05 {clock(k)} INFO {json.dumps({'u': float(U[k]), 'x': float(X[k])})}"
    ),
    "logfmt": lines("", lambda k: f'ts=2024-03-05T{clock(k, ".")}Z level=info msg="a step" u={U[k]} x={X[k]}'),
    "journald": lines("", lambda k: f"2024-03-05T{clock(k, '.')}000+0100 host loop[12]: u={U[k]} x={X[k]}"),
    "line protocol": lines("", lambda k: f"a,axis=1 u={U[k]},x={X[k]} {1709632800000000000 + 10**6 * k}"),
    "names in any order": lines("", lambda k: f"t={T[k]} " + " ".join([f"u={U[k]}", f"x={X[k]}"][:: 1 - 2 * (k % 2)])),
    "names with units": lines("", lambda k: f"t={T[k]}s u={U[k]}V x={X[k]}um"),
    "names with colons": lines("", lambda k: f"t: {T[k]}, u: {U[k]}, x: {X[k]}"),
    "maps of YAML": lines("", lambda k: f"- {{t: {T[k]}, u: {U[k]}, x: {X[k]}}}"),
    "PlotJuggler": lines("__time,u,x\n", lambda k: f"{T[k]:.6f},{U[k]},\n{T[k]:.6f},,{X[k]}"),
    "Campbell": lines(TOA5, lambda k: f'"2024-03-05 {clock(k, ".")}",{k},{U[k]},{X[k]}'),
    "Graphtec with alarms": lines(
        GL840, lambda k: f"{k + 1},2024/03/05 10:00:0{(950 + k) // 1000},{(950 + k) % 1000},{U[k]},{X[k]},LLLL"
    ),
    "catman": CATMAN + rows("\t", T, U, X, decimal=","),
    "Rohde & Schwarz": "in s,u in V,x in um\n" + rows(",", T, U, X),
    "Markdown": "| t | u | x |\n|---|---|---|\n"
    + "".join(f"|{r.replace(',', '|')}|\n" for r in rows(",", T, U, X).split()),
    "polars": "\u250c\u2500\u252c\u2500\u252c\u2500\u2510\n\u2502 t \u2506 u \u2506 x \u2502\n\u255e\u2550\u256a\u2550\u256a\u2550\u2561\n"
    + "".join(f"\u2502{r.replace(',', chr(0x2506))}\u2502\n" for r in rows(",", T, U, X).split())
    + "\u2514\u2500\u2534\u2500\u2534\u2500\u2518\n",
    "a print of pandas": lines("      t      u      x\n", lambda k: f"{k:<4d} {T[k]} {U[k]} {X[k]}"),
    "Arduino's monitor": lines("", lambda k: f"{clock(k, '.')} -> {U[k]},{X[k]}"),
    "long rows of Zurich Instruments": lines(
        "chunk;timestamp;fieldname;value\n",
        lambda k: f"0;{8.4e10 + 60 * k:.0f};u;{U[k]}\n0;{8.4e10 + 60 * k:.0f};x;{X[k]}",
    ),
    "circuit simulator": lines(
        "t,u (V),x (m)\n",
        lambda k: f"{T[k]},{f'{1e3 * U[k]:.6g}m' if k % 2 else f'{U[k]:.6g}'},{X[k]:.7g}u",
    ),
}
UNITS = {
    "names with units": ("V", "um"),
    "Campbell": ("V", "um"),
    "Graphtec with alarms": ("V", "um"),
    "catman": ("V", "um"),
    "Rohde & Schwarz": ("V", "um"),
    "circuit simulator": ("V", "m"),
}
CAN = "data base of the bus"
REFUSED = {  # program: its file, what is said
    "candump -l": (lines("", lambda k: f"({1.7e9 + T[k]:.6f}) can0 1A3#{stepped(k).replace(' ', '')}"), CAN),
    "candump": (lines("", lambda k: f" (000.{k:06d})  can0  123   [8]  {stepped(k)}"), CAN),
    "Vector": (
        lines("base hex  timestamps absolute\n", lambda k: f"   {T[k]:.6f} 1  123             Rx   d 8 {stepped(k)}"),
        CAN,
    ),
    "PEAK": (lines(";$FILEVERSION=1.1\n", lambda k: f"{k + 1:6d})  {1000 * T[k]:11.1f}  Rx         0300  8  {stepped(k)}"), CAN),
    "SavvyCAN": (
        lines(
            "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n",
            lambda k: f"{1000 * k},00000123,false,Rx,0,8,{stepped(k).replace(' ', ',')}",
        ),
        CAN,
    ),
    "python-can": (
        lines("timestamp,arbitration_id,extended,remote,error,dlc,data\n", lambda k: f"{T[k]},0x123,0,0,0,8,EjRW"),
        CAN,
    ),
    "BLF": ("LOGG\x90\x00\x00\x00", CAN),
    "a bag of ROS": ("#ROSBAG V2.0\n\x00", "rostopic echo"),
    "messages of ROS": (lines("", lambda k: f"header:\n  seq: {k}\nu: {U[k]}\nx: {X[k]}\n---"), "rostopic echo -p"),
    "VCD": ("$timescale 1ns $end\n$var real 64 a u $end\n" + lines("", lambda k: f"#{k}\nr{U[k]} a"), "is VCD"),
    "HTML": ("<html><table>\n" + lines("", lambda k: f"<tr><td>{T[k]}</td><td>{U[k]}</td></tr>"), "is a page of HTML"),
    "a shortened print": ("     t    u\n0  0.0  1.0\n1  0.1  1.1\n..  ...  ...\n8  0.8  1.8\n9  0.9  1.9\n", "rows left out"),
    "blocks of MATLAB": ("x =\n\n  Columns 1 through 3\n\n  1.0 2.0 3.0\n\n  Columns 4 through 6\n\n 4.0 5.0 6.0\n", "broken into blocks"),
    "a bus of messages": (lines("", lambda k: f"a/u {U[k]}\na/x {X[k]}"), "one reading a row and no time"),
    "two sources": (
        lines("", lambda k: f"axis1: t={T[k]} u={U[k]} x={X[k]}\naxis2: t={T[k]} u={X[k]} x={U[k]}"),
        "lines of several kinds ('axis1:', 'axis2:')",
    ),
    "a name twice": (lines("", lambda k: f"t={T[k]} u={U[k]} u={X[k]}"), "names a number twice in line 1"),
    "several units of a name": (lines("", lambda k: f"t={T[k]} u={U[k]}{'V' if k % 2 else 'mV'}"), "in several units"),
}  # fmt: skip
