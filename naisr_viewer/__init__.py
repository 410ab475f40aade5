"""The desktop program: drag age, weight and sex and watch the anatomy change."""
