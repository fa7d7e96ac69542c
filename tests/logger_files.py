"""Short files in the style of loggers: each writes the same three columns, 60 rows 1 ms apart, as that program does."""

from __future__ import annotations

import datetime
from collections.abc import Callable

import numpy as np

N = 60
T = np.round(0.001 * np.arange(N), 6)
U = np.round(1.2 * np.sin(0.4 * np.arange(N)), 5)
X = np.round(55 * np.cos(0.3 * np.arange(N)) + 0.1, 4)
START = datetime.datetime(2024, 3, 5, 10, 0, 0)


def rows(separator: str, *columns, decimal: str = ".", tail: str = "") -> str:
    lines = (
        separator.join(f"{value:.10g}" for value in row).replace(".", decimal) for row in zip(*columns, strict=True)
    )
    return "".join(f"{line}{tail}\n" for line in lines)


def keysight() -> bytes:
    return ("x-axis,1,2\nsecond,Volt,Volt\n" + rows(",", T, U, X)).encode()


def labview_lvm() -> bytes:
    head = (
        "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t,\nMulti_Headings\tNo\n"
        "X_Columns\tOne\nTime_Pref\tRelative\nOperator\tA\nDate\t2024/03/05\nTime\t10:00:00,123456\n***End_of_Header***\t\n\t\n"
        "Channels\t2\t\t\nSamples\t60\t60\t\nDate\t2024/03/05\t2024/03/05\t\nTime\t10:00:00,1\t10:00:00,1\t\nY_Unit_Label\tVolts\tum\t\n"
        "X_Dimension\tTime\tTime\t\nX0\t0,0E+0\t0,0E+0\t\nDelta_X\t0,001\t0,001\t\n***End_of_Header***\t\t\t\nX_Value\tdrive\tposition\tComment\n"
    )
    lines = rows("\t", T, U, X, decimal=",").split("\n")
    return (head + "\n".join([lines[0] + "\tfirst row", *lines[1:]])).encode("cp1252")


def picoscope() -> bytes:
    head = "Time,Channel A,Channel B\n(ms),(V),(um)\n\n"
    return (head + rows(",", 1000 * T, U, X)).replace("\n", "\r\n").encode()


def tektronix() -> bytes:
    head = (
        "Model,MSO44\nLabel,,\nWaveform Type,ANALOG,\nPoint Format,Y,\nHorizontal Units,s\nHorizontal Scale,4E-3\nSample Interval,1E-3\n"
        "Record Length,60\nVertical Units,V,um\n\n\n\nTIME,CH1,CH2\n"
    )
    return (head + rows(",", T, U, X)).encode()


def tektronix_beside() -> bytes:
    keys = ["Record Length,6.0e+01,Points", "Sample Interval,1.0e-03,s", "Trigger Point,3.0e+01,Samples", "Source,CH1,"]
    lines = rows(",", T, U, X).splitlines()
    return "".join(f"{keys[k] if k < len(keys) else ',,'},{line},\n" for k, line in enumerate(lines)).encode()


def rigol() -> bytes:
    head = "X,CH1,CH2,Start,Increment,\nSequence,Volt,Volt,0.000000e+00,1.000000e-03\n"
    return (head + rows(",", np.arange(N), U, X, tail=",,")).encode()


def lecroy() -> bytes:
    head = "LECROYWS434,12345,Waveform\nSegments,1,SegmentSize,60\nSegment,TrigTime,TimeSinceSegment1\n#1,05-Mar-2024 10:00:00,0\n"
    return (head + "Time,Ampl,Pos\n" + rows(",", T, U, X)).encode()


def saleae() -> bytes:
    return ("Time [s],Channel 0,Channel 1\n" + rows(",", T, U, X)).encode()


def renishaw() -> bytes:
    head = "HEADER::\nFile: run.rtl\nTitle: linear\nDate: 10:00:00 Mar 05 2024\n\nRUN DATA::\nTime (s)\tDrive (V)\tPosition (um)\n"
    return (head + rows("\t", T, U, X)).encode("utf-16")


def zygo() -> bytes:
    head = "ZMI Data Log\r\nChannels: 2\r\nUnits: um\r\n\r\nTime(s)    Drive(V)    Axis1(um)\r\n"
    return (head + "".join(f"{t:12.6f}{u:12.5f}{x:14.4f}\r\n" for t, u, x in zip(T, U, X, strict=True))).encode()


def polytec() -> bytes:
    head = "Source File Name:\trun.pvd\nSignal:\tTime - Vib\n\nTime\tReference\tDisplacement\n[ s ]\t[ V ]\t[ µm ]\n"
    return (head + rows("\t", T, U, X, tail="\t")).encode("cp1252")


def gcs_array() -> bytes:
    head = (
        " # REM E-727\n # VERSION = 1\n # TYPE = 1\n # SEPARATOR = 32\n # DIM = 2\n # SAMPLE_TIME = 0.001000\n # NDATA = 60\n"
        " # NAME0 = Control Voltage of Axis 1\n # NAME1 = Current Position of Axis 1\n # END_HEADER\n"
    )
    return (head + rows(" ", U, X)).encode()


def aerotech() -> bytes:
    head = "Aerotech Scope Data\nSample Rate (Hz): 1000\nPoints: 60\n\nTime (ms)\tVoltage Command X (V)\tPosition Feedback X (um)\n"
    return (head + rows("\t", 1000 * T, U, X)).encode()


def twincat() -> bytes:
    pairs = {
        "Name": ("Drive", "ActPos"),
        "SymbolComment": ("", ""),
        "Data-Type": ("REAL64", "REAL64"),
        "SampleTime[ms]": ("1", "1"),
    }
    pairs |= {"VariableSize": ("8", "8"), "Port": ("851", "501"), "Offset": ("0", "0"), "ScaleFactor": ("1", "1")}
    head = "Name\tScope Project\nFile\tC:\\run.csv\nStarttime of export\t133541712000000000\tTuesday, 5 March 2024\t10:00:00.000\n"
    head += "Endtime of export\t133541712000600000\tTuesday, 5 March 2024\t10:00:00.060\n\n\n"
    head += "".join(f"{key}\t{a}\t{key}\t{b}\n" for key, (a, b) in pairs.items()) + "\n"
    return (head + rows("\t", 1000 * T, U, 1000 * T, X) + "EOF\n").encode("utf-8-sig")


def siemens() -> bytes:
    head = '"Time";"Time stamp";"Drive.U";"Axis.ActualPosition"\n'
    stamps = [(START + datetime.timedelta(seconds=float(t))).strftime("%d.%m.%Y %H:%M:%S.%f") for t in T]
    body = [f'{t};"{s}";{u};{x}' for t, s, u, x in zip(T, stamps, U, X, strict=True)]
    return (head + "\n".join(body) + "\n").encode()


def b_and_r() -> bytes:
    head = "Trace;B&R Automation Studio\nDate;2024-03-05\n\nTime [s];gAxis.Drive [V];gAxis.ActPos [um]\n"
    return (head + rows(";", T, U, X)).encode()


def dspace_csv() -> bytes:
    head = "descr;ControlDesk;;\npath;;Platform()://u;Platform()://x\nname;time;u;x\nunit;s;V;um\ntrace_values;"
    lines = rows(";", T, U, X).splitlines()
    return (head + "\n;".join(lines) + "\n").encode()


def imc() -> bytes:
    return ("Time[s];u[V];x[µm]\n" + rows(";", T, U, X, decimal=",")).encode("cp1252")


def diadem() -> bytes:
    return ("Zeit;Spannung;Weg\ns;V;µm\n" + rows(";", T, U, X, decimal=",")).encode("cp1252")


def origin() -> bytes:
    return ("Time\tDrive\tPosition\ns\tV\tum\nrun 1\tdrive\tstage\n" + rows("\t", T, U, X)).encode()


def matlab_writetable() -> bytes:
    return ("time,drive,position\n" + rows(",", T, U, X)).encode()


def r_write_csv() -> bytes:
    lines = rows(",", T, U, X).splitlines()
    return ('"","t","u","x"\n' + "\n".join(f'"{k}",{line}' for k, line in enumerate(lines, 1)) + "\n").encode()


def r_write_table() -> bytes:
    lines = rows(" ", T, U, X).splitlines()
    return ('"t" "u" "x"\n' + "\n".join(f'"{k}" {line}' for k, line in enumerate(lines, 1)) + "\n").encode()


def german_excel() -> bytes:
    return (
        ("sep=;\nZeit in s;Spannung (V);Weg (µm)\n" + rows(";", T, U, X, decimal=",", tail=";"))
        .replace("\n", "\r\n")
        .encode("cp1252")
    )


def pandas_index() -> bytes:
    lines = rows(",", T, U, X).splitlines()
    return (",0,1,2\n" + "\n".join(f"{k},{line}" for k, line in enumerate(lines)) + "\n").encode()


def benchvue() -> bytes:
    head = "Keysight BenchVue,,,\nInstrument,34465A,,\nScan,Time,Channel 1 (VDC),Channel 2 (um)\n"
    stamps = [f"3/5/2024 10:00:00:{k:03d}" for k in range(N)]
    return (
        head + "".join(f"{k + 1},{s},{u},{x}\n" for k, (s, u, x) in enumerate(zip(stamps, U, X, strict=True)))
    ).encode()


def grafana() -> bytes:
    stamps = [(START + datetime.timedelta(seconds=float(t))).strftime("%Y-%m-%d %H:%M:%S.%f")[:-3] for t in T]
    body = [f'"{s}","{u} V","{x} µm"' for s, u, x in zip(stamps, U, X, strict=True)]
    return ('"Time","drive","position"\n' + "\n".join(body) + "\n").encode()


def influx() -> bytes:
    head = "#group,false,false,true,true,false,false,true,true\n#default,_result,,,,,,,\n"
    head += ",result,table,_start,_stop,_time,_value,_field,_measurement\n"
    body = [
        f",,{j},2024-03-05T09:00:00Z,2024-03-05T11:00:00Z,2024-03-05T10:00:00.{k:03d}Z,{values[k]},{name},stage"
        for j, (name, values) in enumerate((("u", U), ("x", X)))
        for k in range(N)
    ]
    return (head + "\n".join(body) + "\n").encode()


def excel_dates() -> bytes:
    days = [f"{45356.416666666667 + t / 86400:.12f}" for t in T]
    return ("Date Time,u (V),x (um)\n" + "".join(f"{d},{u},{x}\n" for d, u, x in zip(days, U, X, strict=True))).encode()


def two_times() -> bytes:
    stamps = [(START + datetime.timedelta(seconds=float(t))).isoformat(timespec="milliseconds") for t in T]
    body = [f"{s},{1000 * t:.0f},{u},{x}" for s, t, u, x in zip(stamps, T, U, X, strict=True)]
    return ("Timestamp,Elapsed (ms),u (V),x (um)\n" + "\n".join(body) + "\n").encode()


def ros_bag() -> bytes:
    head = "%time,field.header.seq,field.header.frame_id,field.u,field.x\n"
    body = [f"{1709632800000000000 + 1000000 * k},{k},base,{U[k]},{X[k]}" for k in range(N)]
    return (head + "\n".join(body) + "\n").encode()


def merged_header() -> bytes:
    head = ";Stellgröße;;Messung\nZeit;Soll;Ist;x\ns;V;V;µm\n"
    return (head + rows(";", T, U, U, X, decimal=",")).encode("cp1252")


LOGGERS: dict[str, tuple[Callable[[], bytes], str, tuple[str | int | None, str | int, str | int], dict[str, str]]] = {
    # logger: its file, ending, columns of time, drive and reading, units that the file states
    "Keysight": (keysight, ".csv", ("x-axis", "1", "2"), {"x-axis": "s"}),
    "LabVIEW": (labview_lvm, ".lvm", ("X_Value", "drive", "position"), {}),
    "PicoScope": (picoscope, ".csv", ("Time", "Channel A", "Channel B"), {"Time": "ms", "Channel B": "um"}),
    "Tektronix": (tektronix, ".csv", ("TIME", "CH1", "CH2"), {}),
    "Tektronix TDS": (tektronix_beside, ".csv", (3, 4, 5), {}),
    "Rigol": (rigol, ".csv", (None, "CH1", "CH2"), {"X": "1"}),
    "LeCroy": (lecroy, ".csv", ("Time", "Ampl", "Pos"), {}),
    "Saleae": (saleae, ".csv", ("Time", "Channel 0", "Channel 1"), {"Time [s]": "s"}),
    "Renishaw": (renishaw, ".txt", ("Time", "Drive", "Position"), {"Position (um)": "um"}),
    "Zygo": (zygo, ".dat", ("Time", "Drive", "Axis1"), {"Axis1(um)": "um"}),
    "Polytec": (polytec, ".txt", ("Time", "Reference", "Displacement"), {"Displacement": "um"}),
    "Physik Instrumente": (gcs_array, ".dat", (None, "Control Voltage of Axis 1", "Current Position of Axis 1"), {}),
    "Aerotech": (aerotech, ".plt", ("Time", "Voltage Command X", "Position Feedback X"), {"Time (ms)": "ms"}),
    "TwinCAT": (twincat, ".csv", ("time of Drive", "Drive", "ActPos"), {}),
    "Siemens": (siemens, ".csv", ("Time stamp", "Drive.U", "Axis.ActualPosition"), {}),
    "B&R": (b_and_r, ".csv", ("Time", "gAxis.Drive", "gAxis.ActPos"), {"gAxis.ActPos [um]": "um"}),
    "dSPACE": (dspace_csv, ".csv", ("time", "u", "x"), {"time": "s", "x": "um"}),
    "imc": (imc, ".asc", ("Time", "u", "x"), {"x[µm]": "um"}),
    "DIAdem": (diadem, ".csv", ("Zeit", "Spannung", "Weg"), {"Weg": "um"}),
    "Origin": (origin, ".txt", ("Time", "Drive", "Position"), {"Position": "um"}),
    "MATLAB": (matlab_writetable, ".csv", ("time", "drive", "position"), {}),
    "R write.csv": (r_write_csv, ".csv", ("t", "u", "x"), {}),
    "R write.table": (r_write_table, ".txt", ("t", "u", "x"), {}),
    "Excel in German": (german_excel, ".csv", ("Zeit in s", "Spannung", "Weg"), {"Weg (µm)": "um"}),
    "BenchVue": (benchvue, ".csv", ("Time", "Channel 1", "Channel 2"), {"Channel 1 (VDC)": "V"}),
    "Grafana": (grafana, ".csv", ("Time", "drive", "position"), {"drive": "V", "position": "um"}),
    "InfluxDB": (influx, ".csv", ("_time", "u", "x"), {}),
    "dates of a spreadsheet": (excel_dates, ".csv", ("Date Time", "u", "x"), {"x (um)": "um"}),
    "two times": (two_times, ".csv", ("Timestamp", "u", "x"), {"x (um)": "um"}),
    "ROS": (ros_bag, ".csv", ("time", "field.u", "field.x"), {}),
    "merged header": (merged_header, ".csv", ("Zeit", "Soll", "x"), {"x": "um", "Zeit": "s"}),
    "pandas": (pandas_index, ".csv", ("0", "1", "2"), {}),
}
