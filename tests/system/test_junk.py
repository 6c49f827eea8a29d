"""Random junk gets one clear error of the library, from every public function and command."""

import contextlib
import io
import warnings

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from junk import Stranger, command_lines, files, junk, numbers, parameters, targets

from template_control.cli.main import main
from template_control.errors import TemplateControlError

SHARE = settings(
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=list(HealthCheck),
    print_blob=False,
)


def one_call(data, folder):
    """Call something public with good arguments, of which some are replaced with junk."""
    calls = targets(folder)
    function = data.draw(st.sampled_from(list(calls)))
    good = calls[function]
    names = data.draw(
        st.lists(st.sampled_from(parameters(function, good)), min_size=1, max_size=2, unique=True)
    )
    bad = {name: data.draw(st.one_of(numbers, junk)) for name in names}
    with warnings.catch_warnings(), contextlib.suppress(TemplateControlError):
        warnings.simplefilter("ignore")
        function(**{**good, **bad})


def test_a_stranger_for_every_parameter(tmp_path):
    """Each parameter of all that is public refuses, or leaves alone, what cannot be printed."""
    missed = []
    for function, good in targets(tmp_path).items():
        for name in parameters(function, good):
            try:
                function(**{**good, name: Stranger()})
            except TemplateControlError:
                pass
            except Exception as error:
                missed.append(f"{function.__qualname__}: {name}: {type(error).__name__}: {error}")
    assert not missed, missed


@pytest.mark.slow(seconds=1)
@given(data=st.data())
@settings(SHARE, max_examples=100)
def test_junk_for_public_functions(tmp_path_factory, data):
    one_call(data, tmp_path_factory.getbasetemp())


@pytest.mark.slow(seconds=4)
@given(data=st.data())
@settings(SHARE, max_examples=500)
def test_much_junk_for_public_functions(tmp_path_factory, data):
    one_call(data, tmp_path_factory.getbasetemp())


def one_command(data, folder, kept):
    """Run a command with junk in this process; it ends as commands end, and harms no file."""
    line = data.draw(command_lines(folder))
    with contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with contextlib.redirect_stderr(io.StringIO()) as told:
            try:
                status = main(line)
            except SystemExit as ended:  # argparse's own way out
                status = ended.code
    assert status in (0, 1, 2)
    if status == 2:
        assert "Traceback" not in told.getvalue()
        assert told.getvalue().strip()
    for path, content in kept.items():
        assert path.read_bytes() == content


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder to run commands in, with files good and bad."""
    folder = tmp_path_factory.mktemp("junk")
    (folder / "folder").mkdir()
    kept = files(folder)
    with contextlib.chdir(folder):
        yield folder, kept


@pytest.mark.slow(seconds=1)
@given(data=st.data())
@settings(SHARE, max_examples=40)
def test_junk_for_commands(place, data):
    one_command(data, *place)


@pytest.mark.slow(seconds=5)
@given(data=st.data())
@settings(SHARE, max_examples=300)
def test_much_junk_for_commands(place, data):
    one_command(data, *place)
