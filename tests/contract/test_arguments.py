"""One dictionary of arguments over all public signatures: the same thing has the same name."""

from __future__ import annotations

import inspect
import types
from collections.abc import Iterator

import flightid

# The words that every verb shares. A name that is not here belongs to one room alone (OWN below).
DICTIONARY = {
    "source": "anything with a model: a fit, a model, a response, a connection",
    "sources": "several of them by name",
    "model": "what `identify` takes: structure, start values and bounds",
    "fit": "a result of `identify`",
    "fits": "several of them",
    "data": "a response or records, where either will do",
    "record": "one record",
    "records": "one record or several",
    "responses": "frequency responses of several pairs of channels",
    "validation": "records that a fit has not seen",
    "log": "a flight log",
    "inputs": "channels that drive; before outputs",
    "outputs": "channels that answer; after inputs",
    "excitations": "injected signals, independent of noise",
    "others": "channels without a role",
    "channel": "one channel by name",
    "channels": "several channels by name",
    "names": "names of channels, models or outputs",
    "name": "name of what is made or looked up",
    "units": "unit by channel",
    "unit": "unit of one channel",
    "band_rad_s": "lowest and highest frequency, rad/s",
    "omega_rad_s": "frequencies, rad/s",
    "n_omega": "number of frequencies in a band",
    "sample_time_s": "time between samples, s",
    "time_s": "instants of samples, s",
    "span_s": "first and last instant, s",
    "window_s": "window lengths, s",
    "period_s": "time after which a signal repeats, s",
    "duration_s": "length in time, s",
    "maximum_step_s": "longest step of an integration, s",
    "hold": "what inputs do between samples",
    "loop": "whether a loop was closed: open or closed",
    "horizon": "samples that a prediction looks ahead, or free_run",
    "initial_state": "trim, zero, measured, estimate, or values by state",
    "settle_s": "first stretch that tells a start and counts in no score, s",
    "input_bias": "constants added to inputs",
    "output_bias": "constants added to outputs",
    "state_bias": "constants added to state derivatives",
    "offsets": "what is taken off each channel",
    "trim": "operating point by channel",
    "noise": "noise that a simulation adds",
    "controller": "what closes a loop",
    "gains": "gains of a controller by name",
    "gyro": "ahead of the gyro filters, or behind them",
    "axis": "roll, pitch or yaw",
    "axes": "several axes",
    "autopilot": "firmware by name",
    "vehicle": "kind or model of an aircraft",
    "method": "algorithm of this verb",
    "estimator": "algorithm of a frequency response",
    "kind": "which of a few shapes",
    "order": "degree or number of states",
    "damping": "damping ratio",
    "minimum_coherence": "coherence below which a point does not count",
    "starts": "number of starts of a search",
    "seed": "seed of random numbers",
    "draws": "random draws",
    "level": "probability of an interval",
    "value": "one number",
    "values": "numbers by name",
    "at": "operating point, or place in a block diagram",
    "path": "file",
    "overwrite": "whether a file may be replaced",
    "note": "free text",
    "notes": "free texts",
    "options": "options of the method, by name",
}

# Names that one room needs for itself, and why no shared word will do.
OWN = {
    "conditioning": (
        "signals as they come from sensors: filters and skews in hertz and seconds",
        "accelerations air_data angles at_s conversion cutoff_hz design deviations estimate "
        "half_width interpolation largest_s position_m rates reference shortest_s skews_s spans_s "
        "vectors velocities zero_phase",
    ),
    "control.autopilots": (
        "what a firmware calls its parameters, filters and clocks",
        "airspeed_scale at_s changes computation_delay_s denominator detuning eas2tas flags flown "
        "gyro_rate_hz integers loop_rate_hz named notch_tracking numerator parameters "
        "rate_rad_s rise_time_s role setpoint_rad_s single_precision with_hold",
    ),
    "control.closed_loop": ("signals of the loop", "actuator logged outside"),
    "control.loops": (
        "numbers of one block of a diagram",
        "block blocks centre_rad_s computation_delay_s corner_rad_s delay_s denominator depth fast "
        "fast_is high lag_s lead_s low numerator pade_order prewarp_rad_s rate_per_s rename signal "
        "slow terms",
    ),
    "control.margins": (
        "what a measured loop is, and guides",
        "bandwidth_guide_rad_s gain_guide_db given peak_guide_db phase_guide_deg rigid "
        "skew unstable_poles",
    ),
    "control.tuning": (
        "requirements of a design and its evidence",
        "accept_red angle_loop by_hand filters gyro_noise name nominal other_loops requirements "
        "rigid sign signs verification verifications",
    ),
    "dynamics": (
        "words of the standards: response types, classes, categories, derivatives",
        "aircraft_class airspeed_m_s attention bar_lock_number category charts correct_bias "
        "expected fixed flight lock_number n_alpha normalisation output_is response_type "
        "rotor_speed_rad_s sign signs speed states t_theta2_s task",
    ),
    "review": ("two flights beside each other", "after before promise review state inspection"),
    "planning": (
        "a sweep and what the vehicle may do meanwhile",
        "amplitude attitude_rad control loop_rate_hz n_records rate_rad_s write_no_go",
    ),
    "plot": (
        "the result that is drawn, by its own noun, and guides in it",
        "curves disk estimates found gain_guide_db loops margins panels phase_guide_deg size",
    ),
    "evidence": ("checks of the gate", "checks required"),
    "excitation": (
        "the shape of a manoeuvre; injection clocks are stated in hertz by their firmware",
        "amplitude clock_hz control excitation fade_in_s fade_out_s hold_cycles "
        "lead_s level_db levels limits magnitude mean_square n_inputs n_records "
        "noise_fraction optimise periods power record_s sample_rate_hz single_precision start_hz "
        "step_s stop_hz tail_s whole_run widths",
    ),
    "export": ("the target's word", "format"),
    "fleet": (
        "a catalogue, and the machines that fill it",
        "earlier forget_gone joint most_rows place retry scheduler sql text type_name workers",
    ),
    "identification": (
        "limits of a reduction; lags of an impulse response; data of many fits",
        "after_rise data_sets drop keep kernel maximum_correlation maximum_cost_rise_percent "
        "maximum_total_cost_rise_percent negligible_cost "
        "maximum_cramer_rao_percent maximum_insensitivity_percent n_lags negative_lags step",
    ),
    "inspection": ("verdicts", "findings"),
    "logs": (
        "messages of a log file, whose rates are stated in hertz",
        "column columns gaps instance max_gap_s roles run sample_rate_hz sid_run",
    ),
    "models": (
        "parts of a model's description, and its orders",
        "content count covariance delay delays_s description expression fixed formula formulas "
        "left matrix max min na nb nc nd nf nk noise_variance operating_point output pade_order "
        "parameter parameters require right solve_for structure system theta tie",
    ),
    "record": (
        "parts of a record and columns of a file",
        "clock_offset_s column_names derive excitation gaps history input_shape interpolation join "
        "join_on join_time_column join_time_unit make max_gap_s "
        "outliers record_column reference resample_to_s role roles samples stamps start_s step "
        "stop_s time_column time_unit",
    ),
    "responses": (
        "arrays of one response, and one pair in the order of its name, output/input",
        "coherence covariance detrend errors input minimum_decades output overlap random_error "
        "response",
    ),
    "simulation": ("parts of a run; two signals that are compared", "measured n_samples place "
                   "predicted substeps weights"),
    "study": ("a folder, a stage to run, what is written after it", "cache gains_file output tune"),
    "table": ("a column by number", "index"),
    "uncertainty": ("a function that carries a covariance", "count digits factor function missing "
                    "place reason scale thing"),
    "validation": (
        "orders of a scan; correlations of residuals by output and input",
        "criterion fitted_input fitted_noise input lags maximum_lag measured na nb nc nd "
        "nf nk output predicted residuals rival rows verdict widths",
    ),
}  # fmt: skip

# What people also call it -> the word of the dictionary.
SYNONYMS = {
    "omega_rad_s": "freq freqs frequency frequencies omega omegas w wn f_hz freq_hz frequencies_hz",
    "band_rad_s": "band_hz band bands frequency_range frequency_band freq_range band_limits",
    "n_omega": "n_frequencies n_freq n_freqs n_points points",
    "sample_time_s": "dt ts sample_time sampling_time sample_period sampling_period step_size fs",
    "initial_state": "initial x0 start_state state0 free_initial",
    "output_bias": "free_bias bias biases output_offset",
    "input_bias": "free_reference reference_shift input_offset",
    "hold": "interpolation_of_inputs intersample zoh foh",
    "window_s": "window windows windows_s window_length",
    "span_s": "span time_range t_range",
    "time_s": "t time times time_stamps",
    "inputs": "input_names u input_channels",
    "outputs": "output_names y output_channels responses_of",
    "excitations": "excitation_channels injections",
    "record": "rec flight_record dataset",
    "records": "recs flights training",
    "source": "plant sys mdl",
    "controller": "compensator law",
    "estimator": "estimation_method algorithm solver",
    "seed": "random_state rng random_seed",
    "starts": "n_starts restarts",
    "level": "confidence alpha probability confidence_level",
    "path": "filename file file_name filepath",
    "horizon": "n_ahead steps_ahead k_step",
}
WORD_OF = {synonym: word for word, many in SYNONYMS.items() for synonym in many.split()}
# Fields of results, which nobody passes, and keys of model files, that have a word of their own.
FIELDS_OF_THEIR_OWN = {
    ("DiskMargin", "alpha"): "the disk's radius, as Seiler, Packard & Gahinet call it",
    ("DiskMargin", "frequency"): "an estimate with its interval, not an array",
    ("FittedRecord", "bias"): "estimates by output",
    ("FittedRecord", "reference_shift"): "estimates by input",
    ("Inspection", "bands"): "one usable band an axis",
    ("Plan", "windows_s"): "the window lengths that a plan asks for",
    ("Record", "dataset"): "the same as an xarray.Dataset",
    ("StateSpaceModel", "biases"): "key of a model file",
    ("StateSpaceModel", "initial"): "key of a model file",
}


def _modules() -> list[types.ModuleType]:
    parts = [getattr(flightid, name) for name in flightid.__all__ if name != "__version__"]
    return [flightid, *(part for part in parts if isinstance(part, types.ModuleType))]


def _public(module: types.ModuleType, name: str) -> object:
    """What a name stands for: the verb, where collecting its file put the module in its place."""
    item = getattr(module, name)
    return getattr(item, name, item) if isinstance(item, types.ModuleType) else item


def _functions() -> Iterator[tuple[str, types.FunctionType]]:
    """Public functions, and public methods of public classes, each once."""
    seen: set[int] = set()
    for module in _modules():
        for name in module.__all__:
            item = _public(module, name)
            if id(item) in seen:
                continue
            seen.add(id(item))
            if inspect.isfunction(item):
                yield name, item
            elif inspect.isclass(item):
                yield from ((f"{name}.{key}", plain) for key, plain in _methods(item, seen))


def _methods(item: type, seen: set[int]) -> Iterator[tuple[str, types.FunctionType]]:
    """Public methods of a class and of the classes of the package above it."""
    for kind in item.__mro__:
        for key, member in vars(kind).items() if kind.__module__.startswith("flightid") else ():
            plain = getattr(member, "__func__", member)
            if not key.startswith("_") and inspect.isfunction(plain) and id(plain) not in seen:
                seen.add(id(plain))
                yield key, plain


def _constructors() -> Iterator[tuple[str, list[str]]]:
    for module in _modules():
        for name in module.__all__:
            item = _public(module, name)
            if inspect.isclass(item) and not issubclass(item, BaseException):
                yield name, [*inspect.signature(item).parameters]


def _arguments(function: types.FunctionType) -> list[str]:
    return [name for name in inspect.signature(function).parameters if name not in ("self", "cls")]


def _room(function: types.FunctionType) -> str:
    return ".".join(function.__module__.split(".")[1:3])


def _own(room: str) -> set[str]:
    """Names of a room: its own lines and those of the folder it lies in."""
    return {
        name
        for key, (_, names) in OWN.items()
        if room == key or room.startswith(f"{key}.")
        for name in names.split()
    }


def _unknown(name: str, function: types.FunctionType) -> list[str]:
    room = _room(function)
    known = DICTIONARY.keys() | _own(room)
    return [
        f"{name}: {argument} is neither in the dictionary nor a word of {room}"
        for argument in _arguments(function)
        if argument not in known
    ]


def _synonyms(name: str, arguments: list[str]) -> list[str]:
    return [
        f"{name}: {argument} is called {WORD_OF[argument]} here"
        for argument in arguments
        if argument in WORD_OF and (name, argument) not in FIELDS_OF_THEIR_OWN
    ]


def _turned(name: str, arguments: list[str]) -> list[str]:
    answers = [k for k, argument in enumerate(arguments) if argument in ("output", "outputs")]
    if "inputs" in arguments and answers and answers[0] < arguments.index("inputs"):
        return [f"{name}: outputs stand before inputs"]
    return []


def test_every_argument_is_a_word_of_the_dictionary_or_of_its_room() -> None:
    functions = list(_functions())
    assert len(functions) > 150
    offenders = [line for name, item in functions for line in _unknown(name, item)]
    assert not offenders, "\n".join(offenders)


def test_no_argument_is_a_synonym() -> None:
    offenders = [line for name, item in _functions() for line in _synonyms(name, _arguments(item))]
    offenders += [line for name, given in _constructors() for line in _synonyms(name, given)]
    assert not offenders, "\n".join(offenders)


def test_inputs_stand_before_outputs() -> None:
    offenders = [line for name, item in _functions() for line in _turned(name, _arguments(item))]
    offenders += [line for name, given in _constructors() for line in _turned(name, given)]
    assert not offenders, "\n".join(offenders)


def test_data_are_records_wherever_only_records_will_do() -> None:
    either = {name for name, item in _functions() if "data" in _arguments(item)}
    assert either <= {"identify", "reduce", "open_loop"}


def test_no_word_of_a_room_is_left_over() -> None:
    used: dict[str, set[str]] = {key: set() for key in OWN}
    for _, item in _functions():
        room = _room(item)
        for key in OWN:
            if room == key or room.startswith(f"{key}."):
                used[key] |= set(_arguments(item))
    left = [
        f"{key}: {name}"
        for key, (_, names) in OWN.items()
        for name in names.split()
        if name not in used[key] and used[key]
    ]
    assert not left, "\n".join(left)


def test_a_synonym_is_no_word_of_the_dictionary() -> None:
    assert not WORD_OF.keys() & DICTIONARY.keys()
    assert set(SYNONYMS) <= DICTIONARY.keys()


def _astray(freq: float, outputs: str, inputs: str, flavour: int) -> None: ...


def test_the_rules_can_fail() -> None:
    assert isinstance(_astray, types.FunctionType)
    assert _synonyms("f", _arguments(_astray)) == ["f: freq is called omega_rad_s here"]
    assert [line.split(" is ")[0] for line in _unknown("f", _astray)] == ["f: freq", "f: flavour"]
    assert _turned("f", _arguments(_astray)) == ["f: outputs stand before inputs"]
    assert _turned("Model", ["output", "inputs"]) == ["Model: outputs stand before inputs"]


def test_writers_take_what_to_write_first_and_then_the_path() -> None:
    wrong = [
        f"{name}({', '.join(arguments)})"
        for name, function in _functions()
        if name.startswith("write_") or name == "export"
        if (arguments := _arguments(function)).index("path") != 1
    ]
    assert not wrong
