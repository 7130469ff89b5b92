"""What columns and lines of a preamble are called, in the languages of the machines, and which units they bear."""

from __future__ import annotations

import re
import unicodedata
from functools import lru_cache
from typing import NamedTuple

from bayesmembrane.ground.units import FORCE, LENGTH, RATIO, SPEED, STRESS, TIME, UNITS, known_units, spelled

TRAVEL, STRAIN, STRETCH, CYCLE = "travel", "strain", "stretch", "cycle"
ROLES = (TIME, TRAVEL, STRAIN, STRETCH, FORCE, STRESS, SPEED, CYCLE)
QUANTITY = {
    TIME: TIME,
    TRAVEL: LENGTH,
    STRAIN: RATIO,
    STRETCH: RATIO,
    FORCE: FORCE,
    STRESS: STRESS,
    SPEED: SPEED,
    CYCLE: RATIO,
}

# English, German, French, Spanish, Polish, Chinese; without accents (see `plain`), compounds by their ends.
_ROLE = {
    SPEED: r"speed|velocity|\w*geschwindigkeit|vitesse|velocidad|predkosc|rate|速度|速率",
    CYCLE: r"cycles?|\w*zyklus|\w*zyklen|ciclos?|cykl|循环|周期",
    STRETCH: r"stretch(?:es)?|stretch ratio|extension ratio|lambda|λ|\w*streckung|rapport d ?allongement|拉伸比|伸长比",
    STRAIN: r"\w*strains?|\w*dehnung|\w*stauchung|deformation|deformacion|odksztalcenie|ε|epsilon|应变|应變|伸长率",
    STRESS: r"stress(?:es)?|\w*spannung|contrainte|esfuerzo|tension|naprezenie|σ|sigma|piola|cauchy|pk1|应力",
    TRAVEL: r"displacement|disp|deflection|extension|elongation|cross ?head|stroke|position|travel|traverse|lvdt|ext"
    r"|\w*weg|\w*verschiebung|\w*verlangerung|\w*verlaengerung|\w*langenanderung|\w*auslenkung|durchbiegung"
    r"|deplacement|allongement|course|fleche|desplazamiento|alargamiento|carrera|elongacion|posicion|recorrido"
    r"|przemieszczenie|wydluzenie|droga|przesuniecie|ugiecie|位移|伸长|行程|变形|挠度|横梁",
    FORCE: r"force|load|\w*kraft|\w*last|charge|effort|fuerza|carga|sila|obciazenie|力|载荷|负荷|荷重|荷载",
    TIME: r"time|\w*zeit|temps|tiempo|czas|godzina|elapsed|时间|時間",
}
_PATTERN = {role: re.compile(rf"(?<![a-z])(?:{words})(?![a-z])") for role, words in _ROLE.items()}
_SYMBOLS = {
    "t": TIME,
    "f": FORCE,
    "dl": TRAVEL,
    "δl": TRAVEL,
    "u": TRAVEL,
    "eps": STRAIN,
}
_TRUE = re.compile(r"true|cauchy|wahre?\w*|vraie?|rationnelle|verdader[ao]|real|rzeczywist\w+|真实|真应")
_ENGINEERING = re.compile(
    r"engineering|eng|nominal\w*|nominell\w*|technische?\w*|conventionnelle?|ingenieril|pk1|piola|inzyniersk\w+|工程|名义"
)
_LOGARITHMIC = re.compile(r"log|logarithmic\w*|logarithmisch\w*|hencky|ln")
# No reading of the test: what was wanted, what was made of it, and what is measured elsewhere.
_ASIDE = re.compile(
    r"soll\w*|\w+sollwert|set ?point|command|cmd|target|demand|consigne|max|maximum|maximal\w*|min|minimum|peak|break"
    r"|bruch|rupture|yield|modulus|modul|mean|average|preset|fmax|ultimate|transverse|lateral|quer|width|breite|break"
    r"|torque|\w*moment|rotation|angle|\w*winkel|twist|couple|preload|vorkraft|start|datum|date|temperature|temperatur|green|lagrange|almansi|energy|arbeit|work|error|desviacion|最大"
)
_RESULT = re.compile(
    r"max|maximum|min|minimum|peak|break|bruch|rupture|yield|modulus|modul|mean|average|ultimate|fmax|最大"
)
_SD = re.compile(r"sd|std|stdev|standard deviation|standardabweichung")
_ABSOLUTE = re.compile(r"abs|absolute?\w*|position|posicion|posicao|pos|位置")
_STANDARD = re.compile(r"standard\w*|standardowe?\w*|标准")

FACTS = {
    "thickness": (LENGTH, r"thickness|\w*dicke|epaisseur|espesor|grubosc|厚度|厚|a0"),
    "width": (LENGTH, r"width|\w*breite|largeur|anchura|ancho|szerokosc|宽度|宽|b0"),
    "gauge_length": (
        LENGTH,
        r"gauge length|gage length|\w*messlange|\w*messlaenge|lo|l0|longueur (?:initiale|utile|de reference)"
        r"|longueur entre reperes|distancia inicial|longitud (?:calibrada|inicial|de referencia)|dlugosc pomiarowa"
        r"|initial length|original length|标距|原始标距",
    ),
    "grip_length": (
        LENGTH,
        r"grip separation|grip to grip\w*|\w*einspannlange|\w*einspannlaenge|clamping length|夹具间距",
    ),
    "area": (
        "area",
        r"cross ?section\w*|(?:cross ?sectional )?area|\w*querschnitt\w*|section|superficie|przekroj|面积|截面积|s0",
    ),
    "diameter": (LENGTH, r"diameter|\w*durchmesser|diametre|diametro|srednica|直径"),
    "speed": (
        SPEED,
        r"(?:test |crosshead |cross head )?speed|\w*prufgeschwindigkeit|vitesse\w*|velocidad\w*|predkosc|速度|v1"
        r"|test (?:rate|tempo)(?: 1)?$|(?:crosshead|cross head) rate",
    ),
    "strain_length": (LENGTH, r"(?!)"),
    "length": (LENGTH, r"(?:length|lange|longueur|longitud|dlugosc|长度)$"),
}
"""What a preamble says of specimen and test. ``strain_length`` is that of a strain of its own, an extensometer's;
``length`` is one that does not say whether it is free, total or gauge length: both are told and not used."""
_FACT = {name: re.compile(rf"(?<![a-z])(?:{words})(?![a-z0-9])") for name, (_, words) in FACTS.items()}
_H = re.compile(r"h0? \w+$")
"""The symbol of a thickness beside its unit: alone, ``h`` may be hours."""
NAME = re.compile(
    r"(?:specimen|sample)(?: (?:name|id|label|designation|identifier))?|probenbezeichnung|probe|probenname"
    r"|proben ?beschriftung|etykiet\w* probki|etiqueta de la probeta"
    r"|aktuelle probe|eprouvette|nom de l eprouvette|probeta|muestra|probka|试样|试样名称|样品"
)
_EXTENSOMETER = re.compile(
    r"exten[sz]ometer\w*|extensometr\w*|extensometre|langenanderungsaufnehmer|ekstensometr\w*|引伸计"
)
COMPRESSION = re.compile(r"compress\w*|druck(?:versuch|spannung|kraft)|\w*stauch\w*|compresion|sciska\w*|压缩|壓縮")

_AREAS = {"mm2": 1e-6, "cm2": 1e-4, "m2": 1.0, "in2": 0.0254**2}
_UNIT_WORDS = {
    "sec": "s", "secs": "s", "second": "s", "seconds": "s", "sek": "s", "sekunden": "s", "秒": "s", "segundos": "s",
    "minutes": "min", "minute": "min", "mins": "min", "分": "min", "hours": "h", "hour": "h", "hr": "h",
    "inch": "in", "inches": "in", "zoll": "in", "毫米": "mm", "millimeter": "mm", "millimeters": "mm", "micron": "um",
    "microns": "um", "newton": "N", "newtons": "N", "牛": "N", "牛顿": "N", "千牛": "kN", "kp": "kgf",
    "lb": "lbf", "lbs": "lbf", "lb_f": "lbf", "pounds": "lbf", "兆帕": "MPa", "pct": "percent", "prozent": "percent",
    "kg_per_cm2": "kgf_per_cm2", "kp_per_cm2": "kgf_per_cm2", "kg_per_mm2": "kgf_per_mm2", "lbf_per_in2": "psi",
    "microstrain": "um_per_m", "ustrain": "um_per_m", "uε": "um_per_m", "με": "um_per_m", "ue": "um_per_m",
    "in_per_in": "mm_per_mm", "m_per_m": "m_per_m", "cm_per_cm": "mm_per_mm", "nmm-2": "N_per_mm2",
    "mm_per_mn": "mm_per_min", "in_per_minute": "in_per_min", "mm_per_sec": "mm_per_s",
}  # fmt: skip
_MASSES = {"kg": "kgf", "g": "gf"}
_MOMENT = re.compile(r"[kKmM]?N ?[·⋅*.]? ?[cm]?m")
"""A unit of a moment, which without its sign would look like a nanometre."""
_LOWER = {name.lower(): name for name in UNITS if name not in ("mN", "m", "h", "") and len(name) > 0}


def plain(text: str) -> str:
    """Small letters without accents, signs as blanks: what words are compared in."""
    folded = unicodedata.normalize("NFKD", text.casefold().replace("ł", "l").replace("ß", "ss").replace("ø", "o"))
    bare = "".join(c for c in folded if not unicodedata.combining(c))
    return re.sub(r"[\s_\-./:;,()\[\]\"'#*]+", " ", bare).strip()


@lru_cache(maxsize=4096)
def unit_of(text: str, quantity: str = "") -> str:
    """The unit that a text is, as `ground.units` spells it; "" if it is none (``1``, ``-``, ``ratio`` are "one").

    Masses are forces only where ``quantity`` says that a force is meant.
    """
    bare = unicodedata.normalize("NFKC", text).strip().strip("[]()<>{}\"' ").strip().rstrip(".")
    if bare.lower() in ("-", "1", "—", "–", "ratio"):
        return "one"
    if not bare or len(bare) > 12 or _MOMENT.fullmatch(bare):
        return ""
    name = spelled(bare.replace("·", "").replace("**", "").replace("⁻", "-").replace("−", "-"))
    low = name.lower()
    found = name if name in UNITS else _UNIT_WORDS.get(low, "") or _LOWER.get(low, "")
    if not found and quantity in (FORCE, ""):
        found = _MASSES.get(low, "") if quantity == FORCE else ""
    return found if not quantity or not found or found in known_units(quantity) else ""


def area_of(text: str) -> float | None:
    """m^2 of a unit of area, None if it is none."""
    return _AREAS.get(unicodedata.normalize("NFKC", text).strip(" []()").replace("^", "").lower())


class Named(NamedTuple):
    """A header taken apart: the name without its unit, and the unit as it stands there ("" if none)."""

    name: str
    unit: str


_BRACKETED = re.compile(r"^(?P<name>.*?)\s*[\[(（<{](?P<unit>[^\[\](){}（）<>]*)[\])）>}]\s*$", re.DOTALL)
_LAST = re.compile(r"^(?P<name>.+?)(?:\s+in\s+|\s*[/,_]\s*|\s+)(?P<unit>[^\s,_]+)$", re.DOTALL)


def named(header: str) -> Named:
    """``Force [N]``, ``Force (N):``, ``force_N``, ``Force, N``, ``Kraft in N``, ``F/N`` -> (name, unit)."""
    text = " ".join(unicodedata.normalize("NFKC", header).replace("#", " ").split()).strip(" \"'").rstrip(": ")
    found = _BRACKETED.match(text)
    if found and found["name"].strip():
        return Named(found["name"].strip(), found["unit"].strip())
    for i, c in enumerate(text):  # kgf_per_cm2 and N/mm2 have what also divides
        if i and c in " _,/" and (unit := unit_of(text[i + 1 :].strip(" _,/"))) and unit != "one":
            name = re.sub(r"\s+in$", "", text[:i].strip(" _,/"))
            return Named(name, text[i + 1 :].strip(" _,/")) if name else Named(text, "")
    return Named(text, "")


class Reading(NamedTuple):
    """What a header seems to mean.

    role : one of `ROLES`, or "" if it means none of them
    kind : "true", "engineering", "logarithmic" or "" if it does not say
    aside : "" or the word for which it is no reading of the test (a set point, a maximum)
    absolute, standard : it says that it is a position, or the channel that the test is evaluated in
    """

    role: str
    kind: str = ""
    aside: str = ""
    absolute: bool = False
    standard: bool = False


@lru_cache(maxsize=4096)
def reading_of(name: str) -> Reading:
    """What the name of a column (without unit) seems to mean."""
    text = plain(name)
    bare = re.sub(r"\b(?:ch|kanal|channel)? ?\d+\b", " ", text).strip() or text
    if _SD.search(bare) and re.search(r"(?<![a-z])(?:sd|std|stdev|deviation|standardabweichung)(?![a-z])", bare):
        return Reading("", aside="standard deviation")
    role = _SYMBOLS.get(bare, "")
    for candidate in ROLES_BY_RANK:
        if role:
            break
        if _PATTERN[candidate].search(bare):
            role = candidate
    aside = re.search(rf"(?<![a-z])(?:{_ASIDE.pattern})(?![a-z])", bare)
    kind = "true" if _word(_TRUE, bare) else "engineering" if _word(_ENGINEERING, bare) else ""
    if role == STRAIN and _word(_LOGARITHMIC, bare):
        kind = "true"
    return Reading(role, kind, aside.group() if aside else "", _word(_ABSOLUTE, bare), _word(_STANDARD, bare))


ROLES_BY_RANK = (SPEED, CYCLE, STRETCH, STRAIN, STRESS, TRAVEL, FORCE, TIME)


def names_result(name: str) -> bool:
    """Whether a name is that of what is read off a whole test, as a maximum or a modulus."""
    return bool(_RESULT.fullmatch(reading_of(name).aside))


def _word(pattern: re.Pattern[str], text: str) -> bool:
    return bool(re.search(rf"(?<![a-z])(?:{pattern.pattern})(?![a-z])", text))


def fact_of(key: str) -> str:
    """Which fact of specimen or test a key of the preamble names, "" if none."""
    text = plain(key)
    if _H.match(text) and unit_of(named(key).unit, LENGTH):
        return "thickness"
    if len(text) <= 90 and _FACT["gauge_length"].search(text):
        if _EXTENSOMETER.search(text):
            return "strain_length"
        if _PATTERN[STRAIN].search(text):
            return "gauge_length" if _PATTERN[TRAVEL].search(text) else "strain_length"
    if len(text) > 60 or re.search(
        r"(?<![a-z])(?:modul\w*|e modul|strain|dehnung|end|ende|final\w*|koncow\w*|最终)(?![a-z])", text
    ):
        return ""
    for name in ("grip_length", "gauge_length", "area", "thickness", "width", "diameter", "speed", "length"):
        if _FACT[name].search(text):
            return name
    return ""
