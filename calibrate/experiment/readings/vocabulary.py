"""Words of headers, in small letters, by what a column of such a name holds."""


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


ERROR = _words("sd std stdev stddev deviation sigma error errors err uncertainty unc") | {
    "\N{GREEK SMALL LETTER SIGMA}"
}
TIME = _words(
    "time times elapsed duration date datum datetime timestamp zeit uhrzeit temps tiempo tempo "
    "timepoint"
)
DATE = _words("date datum")
OF_DAY = _words("clock uhrzeit")
CLEAR = _words(
    "supernatant supernatants supernate clear clarified clearance überstand klar klarphase "
    "klarwasser surnageant"
)
RATIO = _words("ratio percent percentage")
RELATIVE = _words("relative normalised normalized fractional dimensionless")
"""A ratio beside a height."""
INTERFACE = _words("mudline mudlines interface interfaces")
HEIGHT = _words(
    "height heights level höhe hoehe hauteur altura altezza boundary front suspension slurry "
    "sludge pulp blanket turbid volume vol"
)
SYMBOLS = {"h": False, "z": False, "y": False, "v": True}
"""Letters for a mudline; true of one whose unit is that of a volume."""
BED = _words("sediment sedimented settled bed cake")
READING = _words("reading readings value values measurement measurements measured position")
REPEAT = _words("run tube repeat replicate rep trial test cylinder column")
"""One of several, as in `run 1`, or the vessel, as in `tube height`."""
VESSEL = _words("tube column cylinder")
MEAN = _words("mean avg average mittel mittelwert")
"""Words that change nothing."""
SAMPLE = _words("sample samples probe specimen batch material formulation suspension slurry name")
"""Names that tell suspensions apart where they share columns."""
OTHER = _words(
    "min max minimum maximum range count "
    "initial total vessel liquid water room diameter start fill full filled fraction temperature "
    "temp ph mass weight velocity speed rate flux density viscosity concentration turbidity "
    "number no index id"
)
"""A column of something else, whatever its other words."""

HOURS_FIRST = _words("hh:mm h:mm h:m hh:mm:ss h:mm:ss h:m:s h:min hh:min h:min:s")
MINUTES_FIRST = _words("mm:ss m:ss m:s min:s min:ss min:sec")
"""Words in the place of a unit where times are those of a clock."""
FOREIGN = _words(
    "y yr yrs year years month months mo ms us ns kg g mg pa kpa bar k °c c °f rpm g/l kg/m3 g/ml "
    "km nm mile miles yd gal oz lb mm/s cm/s m/s mm/min cm/min mm/h cm/h ntu"
)
"""Units in which no time or mudline is read: of another column, or to be converted."""

VELOCITY = _words("velocity velocities speed rate v u v0 u0 vs us geschwindigkeit vitesse")
FLUX = _words("flux fluxes")
CONCENTRATION = _words(
    "concentration conc content loading solids consistency fraction phi c konzentration"
) | {"\N{GREEK SMALL LETTER PHI}"}
BY_VOLUME = _words("vol volume volumetric phi") | {"\N{GREEK SMALL LETTER PHI}"}
BY_WEIGHT = _words("wt weight mass w massic")
PERCENT = _words("% percent percentage pct prozent")
FRACTION = _words("fraction frac phi") | {"\N{GREEK SMALL LETTER PHI}"}
LIQUID = _words("water liquid fluid oil solvent carrier")
SOLID = _words("solid solids particle particles powder sediment beads")
OVER = _words("per to ratio / kg g")
"""Words between solid and liquid where one is divided by the other."""
