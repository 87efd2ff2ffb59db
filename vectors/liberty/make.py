#!/usr/bin/env python3
"""Makes example.lib: a small cell library of invented numbers, about as fast as a 40 nm process.

It lacks what libraries often lack (AND, OR, XNOR, an inverse output, an active-high reset), so that mapping has something to do.
Delays are straight lines in load and slew, so that any interpolation gives the same.
"""

SLEWS = [0.005, 0.02, 0.08, 0.3]  # ns
LOADS = [0.0005, 0.002, 0.008, 0.04]  # pF


def table(kind, base, per_pf, per_slew, template="delay"):
    values = ", \\\n        ".join(
        '"' + ", ".join(f"{base + per_pf * load + per_slew * slew:.6f}" for load in LOADS) + '"' for slew in SLEWS
    )
    return f"      {kind} ({template}) {{\n        values ({values});\n      }}\n"


def arc(related, kind, sense, delay, drive, outputs=("rise", "fall")):
    text = f"    timing () {{\n      related_pin : \"{related}\";\n"
    text += f"      timing_type : {kind};\n" if kind else ""
    text += f"      timing_sense : {sense};\n"
    for edge, slower in (("rise", 1.06), ("fall", 0.94)):
        if edge in outputs:
            text += table(f"cell_{edge}", delay * slower, 4.2 / drive * slower, 0.18)
            text += table(f"{edge}_transition", 0.006, 7.5 / drive * slower, 0.04)
    return text + "    }\n"


def energy(related, pj):
    text = f"    internal_power () {{\n      related_pin : \"{related}\";\n" if related else "    internal_power () {\n"
    for edge, more in (("rise", 1.2), ("fall", 0.8)):
        if related:
            text += table(f"{edge}_power", pj * more, 0.01, 0.001, "energy")
        else:
            text += f"      {edge}_power (scalar) {{ values (\"{pj * more:.6f}\"); }}\n"
    return text + "    }\n"


def pin(name, load, more=""):
    return f"    pin ({name}) {{ direction : input; capacitance : {load:.5f}; {more}}}\n"


def gate(name, drive, area, inputs, function, senses, delay, load):
    text = f"  cell ({name}_{drive}) {{\n    area : {area};\n    cell_leakage_power : {area * 0.5:.3f};\n"
    text += "".join(pin(i, load * drive) for i in inputs)
    text += f"    pin (Y) {{\n    direction : output;\n    function : \"{function}\";\n"
    text += "".join(arc(i, None, s, delay, drive) for i, s in zip(inputs, senses))
    text += "".join(energy(i, 0.0006 * area) for i in inputs)
    return text + "    }\n  }\n"


def limit(kind, rise, fall, related="CK"):
    text = f"    timing () {{\n      related_pin : \"{related}\";\n      timing_type : {kind}_rising;\n"
    for edge, value in (("rise", rise), ("fall", fall)):
        if value is not None:
            text += f"      {edge}_constraint (scalar) {{ values (\"{value}\"); }}\n"
    return text + "    }\n"


def flip_flop(name, area, preset):
    text = f"  cell ({name}_1) {{\n    area : {area};\n    cell_leakage_power : {area * 0.5:.3f};\n"
    text += '    ff (IQ, IQN) { clocked_on : "CK"; next_state : "D"; clear : "!RN"; '
    text += 'preset : "!SN"; clear_preset_var1 : L; clear_preset_var2 : L; }\n' if preset else "}\n"
    text += pin("CK", 0.001, "clock : true; min_pulse_width_high : 0.040; min_pulse_width_low : 0.045; \n" + energy(None, 0.0012))
    text += pin("D", 0.0009, "\n" + limit("setup", 0.025, 0.030) + limit("hold", 0.004, 0.002))
    control = "min_pulse_width_low : 0.040; \n" + limit("recovery", 0.020, None) + limit("removal", 0.015, None)
    text += pin("RN", 0.0012, control)
    text += pin("SN", 0.0012, control) if preset else ""
    text += "    pin (Q) {\n    direction : output;\n    function : \"IQ\";\n"
    text += arc("CK", "rising_edge", "non_unate", 0.055, 1)
    text += arc("RN", "clear", "positive_unate", 0.045, 1, ("fall",))
    text += arc("SN", "preset", "negative_unate", 0.045, 1, ("rise",)) if preset else ""
    text += energy("CK", 0.003) + energy("RN", 0.002) + (energy("SN", 0.002) if preset else "")
    return text + "    }\n  }\n"


HEAD = """/* A small library of invented numbers, made by make.py. */
library (example) {
  delay_model : table_lookup;
  time_unit : "1ns";
  voltage_unit : "1V";
  leakage_power_unit : "1nW";
  capacitive_load_unit (1, pf);
  nom_process : 1;
  nom_voltage : 1.1;
  nom_temperature : 50;
  input_threshold_pct_rise : 50;
  input_threshold_pct_fall : 50;
  output_threshold_pct_rise : 50;
  output_threshold_pct_fall : 50;
  slew_lower_threshold_pct_rise : 20;
  slew_lower_threshold_pct_fall : 20;
  slew_upper_threshold_pct_rise : 80;
  slew_upper_threshold_pct_fall : 80;
"""

NEGATIVE, POSITIVE, NEITHER = "negative_unate", "positive_unate", "non_unate"

if __name__ == "__main__":
    text = HEAD
    for kind, name, slew in (("lu_table", "delay", "input_net_transition"), ("power_lut", "energy", "input_transition_time")):
        text += f"  {kind}_template ({name}) {{\n    variable_1 : {slew};\n"
        text += "    variable_2 : total_output_net_capacitance;\n"
        text += f"    index_1 (\"{', '.join(map(str, SLEWS))}\");\n    index_2 (\"{', '.join(map(str, LOADS))}\");\n  }}\n"
    for drive in (1, 2, 4, 8):
        text += gate("INV", drive, 0.5 * drive + 0.2, "A", "!A", [NEGATIVE], 0.006, 0.0008)
    for drive in (1, 4, 16):
        text += gate("BUF", drive, 0.6 * drive + 0.6, "A", "A", [POSITIVE], 0.018, 0.0004)
    for drive in (1, 2, 4):
        text += gate("NAND2", drive, 0.8 * drive + 0.2, "AB", "!(A B)", [NEGATIVE] * 2, 0.009, 0.0009)
        text += gate("NOR2", drive, 0.8 * drive + 0.2, "AB", "!(A + B)", [NEGATIVE] * 2, 0.012, 0.0009)
    for drive in (1, 2):
        text += gate("XOR2", drive, 1.6 * drive + 0.4, "AB", "A ^ B", [NEITHER] * 2, 0.026, 0.0012)
        text += gate("MUX2", drive, 1.4 * drive + 0.6, ["D0", "D1", "S"], "(D0 !S) + (D1 S)", [POSITIVE, POSITIVE, NEITHER], 0.024, 0.0009)
    text += flip_flop("DFFRN", 4.5, False) + flip_flop("DFFSRN", 5.5, True)
    print(text + "}")
