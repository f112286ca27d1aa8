"""Words of headers, in small letters, grouped by the content of the column."""


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
"""Words that make a height a ratio."""
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
"""Words for one of several repeats, as in `run 1`, or for the vessel, as in `tube height`."""
VESSEL = _words("tube column cylinder")
MEAN = _words("mean avg average mittel mittelwert")
"""Words that do not change the content."""
SAMPLE = _words("sample samples probe specimen batch material formulation suspension slurry name")
"""Words for names of suspensions that share columns."""
OTHER = _words(
    "min max minimum maximum range count "
    "initial total vessel liquid water room diameter start fill full filled fraction temperature "
    "temp ph mass weight velocity speed rate flux density viscosity concentration turbidity "
    "number no index id"
)
"""Words of columns that are not read, whatever their other words."""

HOURS_FIRST = _words("hh:mm h:mm h:m hh:mm:ss h:mm:ss h:m:s h:min hh:min h:min:s")
MINUTES_FIRST = _words("mm:ss m:ss m:s min:s min:ss min:sec")
"""Words in place of a unit for clock times."""
FOREIGN = _words(
    "y yr yrs year years month months mo ms us ns kg g mg pa kpa bar k °c c °f rpm g/l kg/m3 g/ml "
    "km nm mile miles yd gal oz lb mm/s cm/s m/s mm/min cm/min mm/h cm/h ntu"
)
"""Units of other columns, and units of time or height that have to be converted first."""

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
"""Words between solid and liquid that mark a ratio of the two."""
