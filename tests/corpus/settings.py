"""Settings in TOML for a training."""

from __future__ import annotations

from corpus import damage
from corpus.case import OUT, Case, Damage, Ending, Expected, Files, Goods
from corpus.goods import SETTINGS
from corpus.stores import trained
from numpy.random import Generator

WORDS = ("train", "store", "--out", f"{OUT}/mine.safetensors", "--config", "my.toml", "--epochs", "1")


def _case(name: str, text: str | bytes, ending: Ending = "refused", *damages: Damage) -> Case:
    """A training by a file of settings."""

    def make(goods: Goods, rng: Generator) -> Files:
        content = text.encode() if isinstance(text, str) else text
        for each in damages:
            content = each(content, rng)
        return {**{f"store/{key}": value for key, value in goods.store.items()}, "my.toml": content}

    return Case("settings", name, make, WORDS, Expected(ending, trained))


def _network(line: str) -> str:
    """The small networks with another line."""
    name = line.partition("=")[0].strip()
    return "\n".join([row for row in SETTINGS.splitlines() if not row.startswith(f"{name} =")]).replace(
        "[network]", f"[network]\n{line}"
    )


def _training(line: str) -> str:
    """The short training with another line."""
    name = line.partition("=")[0].strip()
    return "\n".join([*(row for row in SETTINGS.splitlines() if not row.startswith(f"{name} =")), line, ""])


_WIDTHS = ("0", "-8", "1.5", '"32"', "true", "1000000000", "[8]")
_RATES = ("nan", "inf", "-1e-3", '"fast"', "1e300")
_POINTS = ("0", "-16", "2.5", "10000000000")
_GOOD = SETTINGS.encode()
CASES = (
    _case("as they are", SETTINGS, "success"),
    _case("a mark", b"\xef\xbb\xbf" + _GOOD, "either"),
    _case("lines of Windows", SETTINGS.replace("\n", "\r\n"), "success"),
    _case("remarks", "# by hand\n" + SETTINGS, "success"),
    _case("the model named", 'model = "naisr"\n' + SETTINGS, "success"),
    _case("UTF-16", SETTINGS, "either", damage.encoded("utf-16")),
    _case("Latin-1", b"# R\xf6hre\n" + _GOOD, "either"),
    _case("another model", 'model = "deepsdf"\n' + SETTINGS),
    _case("an unknown model", 'model = "magic"\n' + SETTINGS),
    _case("a model that is a number", "model = 5\n" + SETTINGS),
    _case("cut", SETTINGS[:-40] + "x = ["),
    _case("a key twice", _training("batch_shapes = 4\nbatch_shapes = 4")),
    _case("a table twice", SETTINGS + "[network]\nlatent = 2\n"),
    _case("an unknown table", SETTINGS + "[colours]\nred = 1\n"),
    _case("an unknown setting", _training("colour = 3")),
    _case("a number for a table", "network = 5\n"),
    _case("a list for a table", "[[network]]\nlatent = 2\n"),
    _case("a date", _training("seed = 2020-01-01")),
    _case("a seed of -1", _training("seed = -1")),
    _case("a seed beyond 64 bits", _training("seed = 99999999999999999999999")),
    _case("nesting", "a = " + "[" * 50_000 + "]" * 50_000),
    _case("a table for a number", _training("batch_shapes = {a = 1}")),
    _case("no layers", _network("template = {width = 8, hidden = -1, omega0 = 5.0}")),
    _case("an omega of nan", _network("template = {width = 8, hidden = 1, omega0 = nan}")),
    _case("an omega of 0", _network("template = {width = 8, hidden = 1, omega0 = 0.0}")),
    *(
        _case(f"a width of {width}", _network(f"template = {{width = {width}, hidden = 1, omega0 = 5.0}}"))
        for width in _WIDTHS
    ),
    *(_case(f"a code of {size}", _network(f"latent = {size}")) for size in ("-2", "0", "10000000000", "2.5")),
    *(_case(f"{dims} dimensions", _network(f"dim = {dims}")) for dims in ("0", "2", "7")),
    *(_case(f"a rate of {rate}", _training(f"template_rate = {rate}")) for rate in _RATES),
    *(_case(f"{count} points", _training(f"surface_points = {count}")) for count in _POINTS),
    *(_case(f"{count} shapes", _training(f"batch_shapes = {count}")) for count in ("0", "-4", '"all"')),
    *(
        _case(f"a share of {share}", _training(f"population_share = {share}"))
        for share in ("nan", "-0.5", "2.0")
    ),
    *(
        _case(f"templates at {value}", _training(f"template_epochs = {value}"))
        for value in ("5", "[-1]", '["a"]')
    ),
    _case("weights of nan", _training("loss = {surface_distance = nan}")),
    _case("a negative weight", _training("loss = {surface_distance = -1.0}")),
    *(
        _case(what, content)
        for what, content in damage.STRANGERS.items()
        if what not in ("nothing", "one byte")
    ),
    *(_case(f"flips {turn}", SETTINGS, "either", damage.flip(3)) for turn in "abcd"),
    _case("swapped blocks", SETTINGS, "either", damage.swap(12)),
)
