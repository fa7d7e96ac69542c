"""How IPOPT ended, as CasADi tells it."""

from __future__ import annotations


def check_signal(return_status: str) -> None:
    """Raises KeyboardInterrupt where a signal stopped IPOPT: CasADi raises nothing else of its own inside it."""
    if return_status in ("User_Requested_Stop", "NonIpopt_Exception_Thrown"):
        raise KeyboardInterrupt
