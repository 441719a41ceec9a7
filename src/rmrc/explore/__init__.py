"""A page with sliders: each change runs the scenario again and redraws the arm, its rates and its errors."""
