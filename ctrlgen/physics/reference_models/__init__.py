"""Independent reference models. They import nothing of ctrlgen, so that a comparison with them is a check."""
