"""What could have been left out: every law at every place of a device."""
