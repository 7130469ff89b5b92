"""Our results beside the paper's."""

from bayesmembrane.data.published import read_published_table
from bayesmembrane.words.beside_paper import LossPair, losses, paper_losses


def test_losses_of_ours_above_the_papers_are_called_a_missed_minimum() -> None:
    assert "missed a minimum" in losses([LossPair("Gent", "OP1", 0.3, 0.2)])
    fine = losses([LossPair("Gent", "OP1", 0.19, 0.2), LossPair("Ogden", "OP2", 0.04, 2.3)])
    assert fine.startswith("No loss of ours lies above")
    assert "less than half of it for Ogden over OP2 (40.0 mN against 2.30 N)" in fine
    assert losses([LossPair("Gent", "OP1", 0.3, None)]) == ""


def test_the_papers_losses_are_those_of_its_own_optima() -> None:
    table = read_published_table()
    found = paper_losses(table)
    assert set(found) == set(table.ranges)
    own = next(row for row in table.rows if row.material == "yeoh" and row.column == table.ranges[1])
    assert found[table.ranges[1]]["yeoh"] == own.loss[1]
