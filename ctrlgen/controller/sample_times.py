"""Which controllers may be called at times that vary: where every state is stepped exactly over any time.

A lag x' = a x + b u under a held drive has x(h) = x + h phi_1(h a) (a x + b u) after any h; the memory of a play does not ask how long a
sample was. What was worked out for one sample time alone is refused with its reason.
"""

from __future__ import annotations

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.model.discretisation import acts_alone
from ctrlgen.model.model import Model

INSTEAD = "leave sample_times out, and tell late calls by step_at"


def check_times(model: Model) -> None:
    """Raises InputError where the controller of a `model` cannot be called at times that vary."""
    if (why := why_one_time(model)) is not None:
        raise InputError(model.name, [Fault("sample_times", f"cannot be kept: the device {why}; {INSTEAD}")])


def why_one_time(model: Model) -> str | None:
    """Why the sample time of a controller cannot vary; None where it can."""
    if model.inertial:
        return "has inertia, and its drives are those of a target in the middle of a sample of one length"
    if model.redundant:
        return "has more drives than axes, whose choice within their rates is worked out for one sample time"
    if model.device.given_at_start:
        return "has constants that are given at the start ([run_time]), from which numbers of one sample time follow"
    if not (model.x.numel() or model.rate_limits):
        return "remembers nothing and its drives have no limits on rates, so that no sample time enters its C"
    if not acts_alone(model):
        return "has states that act on one another, whose step is worked out for one sample time"
    if any(value.is_symbolic() for value in model.stepped.values()):  # a row of samples, each handed to the next
        return "has an effect that keeps samples one by one, such as a delay"
    if model.clocks:
        return "has an effect that counts time by samples"
    return None
