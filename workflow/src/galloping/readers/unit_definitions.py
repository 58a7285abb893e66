"""Units that a column of a file may have, in the syntax of pint.

pint's own registry reads many words as units that are not meant by instruments: `px` is 1/96 inch,
`mil` an angle, `pt` 1/72 inch, `count` a pure number. A unit that is not listed here is unknown.
"""

DEFINITIONS = """
nano- = 1e-9 = n-
micro- = 1e-6 = µ- = μ- = u-
milli- = 1e-3 = m-
centi- = 1e-2 = c-
deci- = 1e-1 = d-
hecto- = 1e2 = h-
kilo- = 1e3 = k-
mega- = 1e6 = M-
giga- = 1e9 = G-

meter = [length] = m = metre
second = [time] = s = sec
kilogram = [mass] = kg
ampere = [current] = A = amp
kelvin = [temperature]; offset: 0 = K = degK
radian = [] = rad

gram = 1e-3 * kilogram = g
tonne = 1000 * kilogram = t
pound = 0.45359237 * kilogram = lb

inch = 0.0254 * meter = in = inches
foot = 0.3048 * meter = ft = feet
yard = 0.9144 * meter = yd
mile = 1609.344 * meter = mi
thou = 2.54e-5 * meter = mil

minute = 60 * second = min
hour = 3600 * second = h = hr
day = 86400 * second = d

percent = 0.01 = %
ppm = 1e-6
degree = 3.141592653589793 / 180 * radian = deg
arcminute = degree / 60 = arcmin
arcsecond = degree / 3600 = arcsec
gon = 3.141592653589793 / 200 * radian = _ = grad
turn = 6.283185307179586 * radian = rev = revolution

hertz = 1 / second = Hz
rpm = turn / minute
knot = 1852 / 3600 * meter / second = kn = kt
mph = mile / hour
mps = meter / second
kmh = 1000 / 3600 * meter / second = kph
standard_gravity = 9.80665 * meter / second ** 2 = g_n = g_0
galileo = 0.01 * meter / second ** 2 = Gal

newton = kilogram * meter / second ** 2 = N
kilopond = standard_gravity * kilogram = kp = kgf
pound_force = standard_gravity * pound = lbf
kip = 1000 * pound_force
joule = newton * meter = J
watt = joule / second = W
pascal = newton / meter ** 2 = Pa
bar = 1e5 * pascal
atmosphere = 101325 * pascal = atm
psi = pound_force / inch ** 2
mmHg = 133.322387415 * pascal = torr

degree_Celsius = kelvin; offset: 273.15 = °C = celsius = degC = degreeC
degree_Fahrenheit = 5 / 9 * kelvin; offset: 255.3722222222222 = °F = fahrenheit = degF = degreeF

volt = watt / ampere = V
ohm = volt / ampere = Ω
coulomb = ampere * second
farad = coulomb / volt
henry = volt * second / ampere
tesla = volt * second / meter ** 2
"""

# Usual prefixes by unit. Others are misprints or no units: `CH1` is a channel and no centihour.
PREFIXES = {
    "meter": {"nano", "micro", "milli", "centi", "deci", "kilo"},
    "second": {"nano", "micro", "milli"},
    "gram": {"milli", "kilo"},
    "radian": {"micro", "milli"},
    "degree": {"milli"},
    "standard_gravity": {"micro", "milli"},
    "galileo": {"milli"},
    "hertz": {"milli", "kilo", "mega"},
    "newton": {"micro", "milli", "kilo", "mega"},
    "pascal": {"milli", "hecto", "kilo", "mega", "giga"},
    "bar": {"milli"},
    "joule": {"milli", "kilo", "mega"},
    "watt": {"milli", "kilo", "mega"},
    "volt": {"nano", "micro", "milli", "kilo"},
    "ampere": {"nano", "micro", "milli", "kilo"},
    "ohm": {"milli", "kilo", "mega"},
    "coulomb": {"nano", "micro", "milli"},
    "farad": {"nano", "micro"},
    "henry": {"micro", "milli"},
    "tesla": {"micro", "milli"},
}
