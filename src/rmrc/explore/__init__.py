"""A page with sliders: a scenario runs again at each change, and the arm, its rates and its errors answer."""
