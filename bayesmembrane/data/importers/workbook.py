"""Workbooks of Excel and LibreOffice: the sheet with the readings is found, the others are searched for the film."""

from __future__ import annotations

import base64
from typing import ClassVar

from bayesmembrane.data.exports.sheets import is_workbook
from bayesmembrane.data.importers.base import TableImporter

_EXAMPLE = (
    "UEsDBBQAAAAIAAAAIVwtXQ7tbAEAAOYCAAAYAAAAeGwvd29ya3NoZWV0cy9zaGVldDEueG1sfVLbTsMwDP2VKh+wdJsGaGoj0SEED0jTJuA5"
    "a902Wi4l8Vb4e5JsK0ViPMW343PsOOuN3bsWAJNPJbXLSYvYLSl1ZQuKu4npQPtMbazi6F3bUNdZ4FUEKUlnaXpDFReasCzG1pZl5oBSaFjb"
    "xB2U4varAGn6nEzJJbARTYsxQFnW8Qa2gK+dB3iXDn0qoUA7YXRioc7J/XRZzCMiVrwJ6N3ITsIwO2P2wXmucpIGTSChxNCC++cIK5AydPJK"
    "Ps5NyQ9pQI7tS/vHOL+Xt+MOVka+iwrbnNyRpIKaHyRuTP8E55kWPxIfOHKWWdMnNgzLsjIYgdIXCh2WtEXr48IzIdt2UIaRM4peRYjR8owp"
    "rmF4+ruaeraBcnahLGZX4Er9A58PiudX4LWQKpn+pfeECGdxZOkkXWT0OGago/2E/3/hthHaJRJqD0snt36L9rTQk4Omi/eyM4hGRbP1dwg2"
    "FPh8bQwOTvjQ4bTZN1BLAwQUAAAACAAAACFcmbMkcbABAABcBAAAGAAAAHhsL3dvcmtzaGVldHMvc2hlZXQyLnhtbIVU246bMBD9FeQPiMmF"
    "7moFSA1V1X1otdr08uzAEKy1MWtPwvbvO3ayFCLSPjGXc+acAZu0N/bFNQAYvWnVuow1iN0D565sQAu3MB201KmN1QIptQfuOguiCiSt+CqO"
    "P3AtZMvyNNSebJ6aIyrZwpON3FFrYX9vQZk+Y0v2XniWhwZDgedpJw6wA/zREYFSPsyppIbWSdNGFuqMfVw+FElgBMRPCb0bxZFfZm/Mi08e"
    "q4zF3hMoKNGPEPQ4QQFK+Unk5PUylP0V9cxx/D7+c9if7O2Fg8KoX7LCJmP3LKqgFkeFz6b/ApedRhY/CRR5ak0fWb9snpY+8JIElK1/STu0"
    "VJekhPl32jflSA58zssLfnsLv0PRVsJWEX2fco5Z/JeJVpxATamcDA+uV4Pr1Y1Zbs7yLfC3OZe3wFr/w9h6MLYOdH8CT3mc8tPYx6S3iOPl"
    "tF/McydCm0FoMwJfDdpupkKbu+RKaZ48UUoGpWQEXl0pJROl5fpKZ5561uGjU+lv3VdhD7J1kYKaOPHijsj2fIzPCZou3NK9QTQ6hA3dfrAe"
    "QP3aGBwSf42GH0r+B1BLAwQUAAAACAAAACFca5L/wosAAADxAAAACwAAAF9yZWxzLy5yZWxzjc87DsIwEATQq1h7gGygoECJK5q0KBcwziax"
    "/FnLdkS4PS4DoqAczehJ093JqWI45NXELHbvQu5hLSVeEbNeyavccKRQm5mTV6XGtGBU2qqF8Ny2F0xHA2R3NMX4ivSPyPNsNN1Yb55C+QF/"
    "LUCMKi1UetgdPjnZB7NtKgpimHpIw3QCgbLDj4fyDVBLAwQUAAAACAAAACFcEJx+ZkgBAABwAgAADwAAAHhsL3dvcmtib29rLnhtbI2R0U7D"
    "MAxFf6XKB9CugklMKy9MwCQEaEN7z1p3tZbEVexusK8naVWohIR4Sn3tntzrLM/kj3uiY/JhjeOFL1Qj0i7SlMsGrOYrasGFXk3eagmlP6RU"
    "11jCisrOgpM0z7J56sFoQXLcYMtqoP2Hxa0HXXEDINYMKKvRqbvl6OzNJ+m0IoEy3hTVqOwQzvwzEMvkhIx7NCifheq/DajEokOLF6gKlamE"
    "Gzo/kccLOdFmW3oyplCzobEDL1j+krfR5rvec6+I3m9i5kLNswCs0bP0Ez1fB5MnCMND1Qk9oBHwKy3w6Klr0R16TIiRTnL0qxjPxGkLhdoA"
    "d0Y4mgjiuhoMSSBN4vkFhoZfVwNz+v9Omw44ODQ2mU0o+R+UfHA22qmgRgfVS+BxbITllOFl4tH7ya9vZrdhCZ0x90F7dc+kq+984+PcfQFQ"
    "SwMEFAAAAAgAAAAhXEjuXPmYAAAAiAEAABoAAAB4bC9fcmVscy93b3JrYm9vay54bWwucmVsc8WQPQqDQBCFr7LMARy1SBHUKo1t8ALLOrqi"
    "+8POhJjbR2yikCJdquG9Bx8fU91p0TIFz3aKrFa3eK7BisQrIhtLTnMWIvltGUJyWraYRozazHokLPP8gunIgKY6MlX3ivQLMQzDZOgWzMOR"
    "ly9gfIY0syUSUJ1OI0kNuC6fmnE/RbaRQbV9DantC1D4b6PyZFTuRnh6fPMGUEsDBBQAAAAIAAAAIVyQhz5N3gAAAIMCAAATAAAAW0NvbnRl"
    "bnRfVHlwZXNdLnhtbMWSvU4DMRCEX8VyG8UbUlCgXBpCCxS8wOLby1nnP3k34Xh7HAMpUEBCQqJa2TM73xS7eXrNxGoOPnKnR5F8A8B2pIBs"
    "UqZYlSGVgFKfZQ8Z7YR7gvVqdQ02RaEoSzll6O1mRwMevKi7uX6zS7HThTxrdftuPLE6jTl7Z1GqDsfYf6EsPwimbjYPjy7zohq0gouIJn1L"
    "+Fx8OFIprif1iEXuMVQbzB5eUpl4JBKGNq7Mz3EXCqdhcJb6ZA+hrhjOhbBvYcGbc/7il0XW/1nkOaXpj/ltmoAungtAu73tG1BLAQIUAxQA"
    "AAAIAAAAIVwtXQ7tbAEAAOYCAAAYAAAAAAAAAAAAAACAAQAAAAB4bC93b3Jrc2hlZXRzL3NoZWV0MS54bWxQSwECFAMUAAAACAAAACFcmbMk"
    "cbABAABcBAAAGAAAAAAAAAAAAAAAgAGiAQAAeGwvd29ya3NoZWV0cy9zaGVldDIueG1sUEsBAhQDFAAAAAgAAAAhXGuS/8KLAAAA8QAAAAsA"
    "AAAAAAAAAAAAAIABiAMAAF9yZWxzLy5yZWxzUEsBAhQDFAAAAAgAAAAhXBCcfmZIAQAAcAIAAA8AAAAAAAAAAAAAAIABPAQAAHhsL3dvcmti"
    "b29rLnhtbFBLAQIUAxQAAAAIAAAAIVxI7lz5mAAAAIgBAAAaAAAAAAAAAAAAAACAAbEFAAB4bC9fcmVscy93b3JrYm9vay54bWwucmVsc1BL"
    "AQIUAxQAAAAIAAAAIVyQhz5N3gAAAIMCAAATAAAAAAAAAAAAAACAAYEGAABbQ29udGVudF9UeXBlc10ueG1sUEsFBgAAAAAGAAYAiwEAAJAH"
    "AAAAAA=="
)
"""A sheet of results and one of three readings, as an xlsx file."""


class Workbook(TableImporter):
    """xlsx, xls and ods; several sheets and specimens, of which one is chosen by ``--sheet`` and ``--part``."""

    name: ClassVar[str] = "workbook"
    title: ClassVar[str] = "workbooks (xlsx, xls, ods) with named columns"
    example: ClassVar[bytes] = base64.b64decode(_EXAMPLE)

    @staticmethod
    def recognises(data: bytes) -> bool:
        return is_workbook(data)
