"""Results for people: figures, self-contained HTML pages, and the JSON beside them."""
