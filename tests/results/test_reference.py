"""The default study (run `make` first) still has the numbers that were published."""


def test_published_numbers_come_out_again(root, hold_to_reference):
    hold_to_reference(root / "results" / "tables", root / "results" / "reference")
