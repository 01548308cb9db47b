"""Experiment files: what they mean, and one line with file and line for everything that is wrong with them."""

from pathlib import Path

import pytest

from shadowbench import experiment
from shadowbench.choices import Choice
from shadowbench.errors import ExperimentError, UsageError
from shadowbench.experiment import Comparison, Printed, TableLayout

GOOD = """\
title = "Maps of two sizes"
source = "Somebody 2004, table 1"
budget = 2.5

[[comparison]]
scene = "random-triangles:triangles=1000/10000"
light = ["sun", "lamp"]
size = ["640x480", "64x48"]
threads = [1, 2]
method = ["ray-traced", {name = "shadow-map", resolution = [512, 2048], receiver_plane = true}]

[[comparison]]
scene = {name = "models/bunny.ply", ground = false}

[[table]]
title = "Cost"
index = "method"
columns = "resolution"
values = ["static_frame_ms", "counters.nodes visited"]
"""


def test_a_file_says_what_is_measured_and_what_is_printed() -> None:
    read = experiment.parse(GOOD, name="maps")
    assert (read.name, read.title, read.source, read.budget_s) == (
        "maps",
        "Maps of two sizes",
        "Somebody 2004, table 1",
        2.5,
    )
    assert read.comparisons == (
        Comparison(
            scenes=(Choice("random-triangles", {"triangles": ("1000", "10000")}),),
            methods=(
                Choice("ray-traced"),
                Choice("shadow-map", {"resolution": (512, 2048), "receiver_plane": (True,)}),
            ),
            lights=("sun", "lamp"),
            sizes=((640, 480), (64, 48)),
            threads=(1, 2),
        ),
        Comparison(scenes=(Choice("models/bunny.ply", {"ground": (False,)}),)),
    )
    assert read.tables == (
        TableLayout("Cost", ("method",), ("static_frame_ms", "counters.nodes visited"), "resolution"),
    )


def test_mesh_files_are_found_from_the_experiment_file(tmp_path: Path) -> None:
    (tmp_path / "maps.toml").write_text(GOOD)
    read = experiment.load(tmp_path / "maps.toml")
    assert read.name == "maps"
    assert read.comparisons[1].scenes[0].name == str(tmp_path / "models/bunny.ply")
    assert read.text == GOOD


PRINTED = """
[[table]]
title = "Table 1"
index = "measure"
columns = "scene.triangles"
values = ["counters.nodes visited", "stages.transformation"]
where = {method = "afsm", light = "sun"}

[[table.printed]]
where = {method = "afsm", "scene.triangles" = [1000, 10_000]}
values = {"counters.nodes visited" = [91e3, 471e3], "stages.transformation" = 130}

[[table.printed]]
where = {"scene.triangles" = 7}
values = {"stages.transformation" = 1.5}
"""


def test_a_table_holds_what_its_source_prints_and_for_which_cases() -> None:
    (layout,) = experiment.parse(HEAD + PRINTED, name="paper").tables
    assert layout.where == {"method": "afsm", "light": "sun"}
    assert layout.printed == (
        Printed(
            {"method": "afsm", "scene.triangles": 1000},
            {"counters.nodes visited": 91e3, "stages.transformation": 130.0},
        ),
        Printed(
            {"method": "afsm", "scene.triangles": 10_000},
            {"counters.nodes visited": 471e3, "stages.transformation": 130.0},
        ),
        Printed({"scene.triangles": 7}, {"stages.transformation": 1.5}),
    )


HEAD = 'title = "x"\n\n[[comparison]]\nscene = "bunny"\n'
TABLE = HEAD + "[[table]]\ntitle = 'a'\nindex = 'method'\nvalues = 'shade_ms'\n"


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("titel = 'x'", 1, "unknown key 'titel'; did you mean 'title'?"),
        ("title = 'x'", None, "the key 'comparison' is missing"),
        ("title = 'x'\n[[comparison]]\nlight = 'sun'", 2, r"the key 'scene' is missing in \[\[comparison\]\]"),
        ("title = 'x'\ncomparison = []", 2, "'comparison' must not be empty"),
        ("title = 'x'\n[comparison]\nscene = 'bunny'", 2, r"write \[\[comparison\]\], not \[comparison\]"),
        (HEAD + "# and now\nmethd = 'pcf'", 6, "unknown key 'methd'; did you mean 'method'?"),
        (HEAD + "method = []", 5, "'method' must not be empty"),
        (HEAD + "method = [\n  'pcf',\n  'pcf',\n]", 5, "'pcf' is listed twice"),
        (HEAD + "method = [\n  'pcf',\n  'pcf:5',\n]", 7, "after the colon come parameters"),
        (HEAD + "method = [\n  {name = 'pcf', kernel = []},\n]", 6, "parameter 'kernel' sweeps an empty list"),
        (HEAD + "method = {kernel = 3}", 5, "a table here needs a 'name'"),
        (HEAD + "method = {name = 'pcf', kernel = {a = 1}}", 5, "parameter 'kernel' must be a number"),
        (HEAD + "method = 3", 5, "expected a name"),
        (HEAD + "size = '0x0'", 5, "a picture has 1 to 16384 pixels a side, not '0x0'"),
        (HEAD + "size = [\n'640x480',\n\n'9x1000000000']", 8, "a picture has 1 to 16384 pixels a side"),
        (HEAD + "pixel_samples = 0", 5, "a number of samples of a pixel lies between 1 and 256, not 0"),
        (HEAD + "layers = [2, 'all']", 5, "a number of layers lies between 1 and 64, not 'all'"),
        (HEAD + "moving = ['object', 'sun']", 5, "nothing moves like 'sun'"),
        (HEAD + "moving = 'objects'", 5, "did you mean 'object'?"),
        (HEAD + "size = [640, 480]", 5, "a size is written WIDTHxHEIGHT"),
        (HEAD + "threads = [1, 0]", 5, "a number of threads lies between 1 and 1024, not 0"),
        (HEAD + "light = ''", 5, "expected a name"),
        (HEAD + "[[table]]\ntitle = 'a'\nindex = 'method'\nvalues = ['shade_sm']", 8, "did you mean 'shade_ms'?"),
        (HEAD + "[[table]]\ntitle = 'a'\nvalues = 'shade_ms'", 5, r"the key 'index' is missing in \[\[table\]\]"),
        (TABLE + "where = {light = [1]}", 9, "a condition is a number, a text, true or false"),
        (
            TABLE + "[[table.printed]]\nvalues = {shade_ms = 1}",
            9,
            r"the key 'where' is missing in \[\[table.printed\]\]",
        ),
        (TABLE + "[[table.printed]]\nwhere = {}\nvalue = 1", 11, "unknown key 'value'; did you mean 'values'?"),
        (TABLE + "[[table.printed]]\nwhere = {}\nvalues = {}", 11, "'values' must not be empty"),
        (
            TABLE + "[[table.printed]]\nwhere = {}\nvalues = {shade_ms = inf}",
            11,
            "is a finite number, not inf",
        ),
        (TABLE + "[[table.printed]]\nwhere = {}\nvalues = {build_ms = 1}", 5, "'build_ms' is printed but not shown"),
        (TABLE + "[[table.printed]]\nwhere = {}\nvalues = {shade_ms = [1]}", 9, "but 'where' has no list"),
        (
            TABLE + "[[table.printed]]\nwhere = {kernel = [1, 2]}\nvalues = {shade_ms = [1, 2, 3]}",
            9,
            "'shade_ms' lists 3 printed values, not 2",
        ),
        (
            TABLE + "[[table.printed]]\nwhere = {kernel = [1, 2], light = ['sun']}\nvalues = {shade_ms = 1}",
            9,
            "the lists in 'where' have different lengths",
        ),
        ("title = 'x'\nbudget = -1\n" + HEAD[12:], 2, "'budget': input should be greater than 0"),
        ("title = 'x'\nname = 'a b'\n" + HEAD[12:], 2, "'name' may hold letters"),
        ("title = 'x'\nscene = \n", 2, "not TOML: invalid value"),
        ("title = 'x'\ntitle = 'y'\n", 2, "not TOML: cannot overwrite a value"),
        ("title = 'x'\nlong = '''\nnever closed\n\n", 3, "not TOML: "),
    ],
)
def test_a_mistake_is_told_in_one_line_with_its_place(text: str, line: int | None, message: str) -> None:
    with pytest.raises(ExperimentError, match=message) as caught:
        experiment.parse(text, name="mine", file="mine.toml")
    assert str(caught.value).startswith("mine.toml" + (f":{line}: " if line else ": "))
    assert "\n" not in str(caught.value)


def test_a_file_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ExperimentError, match="does not exist"):
        experiment.load(tmp_path / "absent.toml")
    with pytest.raises(ExperimentError, match=r"cannot be read: .*directory"):
        experiment.load(tmp_path)
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ExperimentError, match="not UTF-8"):
        experiment.load(tmp_path / "binary.toml")
    with pytest.raises(ExperimentError, match=r"did you mean 'quick'\?"):
        experiment.load("quik")


@pytest.mark.parametrize("name", experiment.builtin_names())
def test_built_in_experiments_are_right_and_their_tables_show_what_exists(name: str) -> None:
    read = experiment.load(name)
    assert read.name == name
    assert read.title
    assert read.description
    assert read.tables


def test_quick_has_between_twelve_and_sixteen_cases() -> None:
    counts = []
    for comparison in experiment.load("quick").comparisons:
        methods = sum(len(list(choice.expand())) for choice in comparison.methods)
        scenes = sum(len(list(choice.expand())) for choice in comparison.scenes)
        counts.append(methods * scenes * len(comparison.lights) * len(comparison.cameras) * len(comparison.sizes))
    assert 12 <= sum(counts) <= 16


def test_options_alone_make_an_experiment_of_every_method_on_the_default_scene() -> None:
    made = experiment.from_options(sizes=["64x48"])
    (comparison,) = made.comparisons
    assert comparison == Comparison((Choice("random-triangles"),), sizes=((64, 48),))


def test_an_option_replaces_what_every_comparison_says() -> None:
    read = experiment.parse(GOOD, name="maps")
    changed = experiment.with_options(read, methods=["pcf:kernel=3/5"], sizes=["8x8"], threads=[1])
    assert len(changed.comparisons) == 2
    for comparison in changed.comparisons:
        assert comparison.methods == (Choice("pcf", {"kernel": ("3", "5")}),)
        assert comparison.sizes == ((8, 8),)
        assert comparison.threads == (1,)
    assert changed.comparisons[0].lights == ("sun", "lamp")
    narrowed = experiment.with_options(changed, scenes=["bunny"], lights=["sun"])
    assert len(narrowed.comparisons) == 1, "comparisons that became equal are measured once"


@pytest.mark.parametrize("options", [{"methods": ["pcf:3"]}, {"sizes": ["big"]}, {"threads": [0]}, {"scenes": [""]}])
def test_a_wrong_option_is_a_usage_error(options: dict[str, list[str]]) -> None:
    with pytest.raises(UsageError):
        experiment.from_options(**options)
