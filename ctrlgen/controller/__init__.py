"""The controller that follows a path sample by sample: what the generated C computes, stated symbolically."""
