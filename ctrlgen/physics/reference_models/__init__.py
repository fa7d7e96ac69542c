"""Independent models that serve as the truth to compare with. They import nothing of ctrlgen's physics."""
