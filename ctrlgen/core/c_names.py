"""Identifiers of C made of the names that a device or its user gives."""

from __future__ import annotations

import re

# Words of C11 and C++17, because the headers are for both; linux and unix are macros of gcc outside strict C.
KEYWORDS = frozenset(
    word
    for line in (
        "alignas alignof and and_eq asm auto bitand bitor bool break case catch char char16_t char32_t class compl const constexpr",
        "const_cast continue decltype default delete do double dynamic_cast else enum explicit export extern false float for friend goto",
        "if inline int linux long mutable namespace new noexcept not not_eq nullptr operator or or_eq private protected public register",
        "reinterpret_cast restrict return short signed sizeof static static_assert static_cast struct switch template this thread_local",
        "throw true try typedef typeid typename union unix unsigned using virtual void volatile wchar_t while xor xor_eq",
    )
    for word in line.split()
)


def c_name(text: str) -> str:
    """`text` as an identifier of C in lower case: what is no ASCII letter or digit is an underscore, a keyword ends in one."""
    name = re.sub(r"\W+", "_", text, flags=re.ASCII).strip("_").lower() or "constant"
    return f"{name}_" if name in KEYWORDS else name
