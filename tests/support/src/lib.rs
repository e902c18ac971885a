//! Tolerances, seeded noise and reference scenarios shared by the tests.
