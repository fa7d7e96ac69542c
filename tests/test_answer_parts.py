"""An answer is kept to three sentences and three lines: what yields, in which order, and where it is told instead."""

from __future__ import annotations

from ctrlgen.diagnosis.report.answer_parts import LONGEST, Part, Yields, composed

CAUSE = Part("explained: a law", ((Yields.TITLE, "explained: law"),))
SHARE = Part("; it takes 82 % (80 ... 84 %)", ((Yields.INTERVAL_OF_SHARE, "; it takes 82 %"),))
KIND = Part("; left: 3 um, mostly a function of time", ((Yields.KIND, "; left: 3 um"), (Yields.MOVED, "")), "of time")


def test_all_is_told_where_there_is_room():
    told = composed([[CAUSE, SHARE], [], [KIND, Part("")]])
    assert told.sentences == (
        "Explained: a law; it takes 82 % (80 ... 84 %).",
        "Left: 3 um, mostly a function of time.",
    )
    assert told.notes == () and len(" ".join(told.sentences)) <= LONGEST


def test_what_matters_least_yields_first_and_stands_in_the_notes():
    whole = " ".join(composed([[CAUSE, SHARE], [KIND]]).sentences)
    forms = [composed([[CAUSE, SHARE], [KIND]], longest) for longest in (len(whole) - 1, 65, 45, 32, 1)]
    assert [" ".join(told.sentences) for told in forms] == [
        "Explained: a law; it takes 82 %. Left: 3 um, mostly a function of time.",
        # what is told after all, where the kind had to yield
        "Explained: a law; it takes 82 % (80 ... 84 %). Left: 3 um.",
        "Explained: a law; it takes 82 %. Left: 3 um.",
        "Explained: a law; it takes 82 %.",
        "Explained: law; it takes 82 %.",
    ]
    assert [told.notes for told in forms] == [(), ("of time",), ("of time",), ("of time",), ("of time",)]


def test_of_two_that_yield_alike_the_latter_is_first():
    one, two = (Part(f"; {name}", ((Yields.UNTRIED, ""),)) for name in ("the first", "the second"))
    assert composed([[one, two]], 15).sentences == ("The first.",)


def test_a_question_stays_one():
    assert composed([[Part("; was a sign changed?")]]).sentences == ("Was a sign changed?",)
