"""Programs that look for what the tests cannot: fuzzing, endurance, lanes, golden episodes."""
