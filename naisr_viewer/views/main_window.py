"""The window: covariates on the left, shapes in the centre, patients on the right, what goes on below."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QSize, Qt, QTimer, Signal
from PySide6.QtGui import QCloseEvent, QDragEnterEvent, QDropEvent, QGuiApplication, QImage, QPaintEvent
from PySide6.QtWidgets import QApplication, QHBoxLayout, QMainWindow, QMenu, QWidget

from naisr_model.errors import InputError
from naisr_model.shipped import shipped, shipped_atlas
from naisr_viewer.panels.kinds import title_of, visible_panels
from naisr_viewer.panels.maps import can_map, words_of_maps
from naisr_viewer.panels.matrix import here
from naisr_viewer.panels.scales import scale_of
from naisr_viewer.state.curves import Curves, Reckoning, Standing
from naisr_viewer.state.drawer import Tab, tabs_of
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.layouts import Layout, Panel
from naisr_viewer.state.patients import Labels
from naisr_viewer.state.pins import Ledger
from naisr_viewer.state.questions import Answer, Question
from naisr_viewer.state.section import Section
from naisr_viewer.state.theme import ThemeChoice
from naisr_viewer.views.actions import (
    COMMANDS,
    EXAMPLE,
    EXAMPLES,
    MENUS,
    RECENT,
    enable,
    facts,
    fill,
    make_actions,
    make_toolbar,
    offer,
)
from naisr_viewer.views.centre import Centre
from naisr_viewer.views.colours import cell_colours, pin_colour
from naisr_viewer.views.covariates.panel import CovariatePanel
from naisr_viewer.views.dialogs.about import about, tell_of_atlas
from naisr_viewer.views.dialogs.documents import DocumentWindow
from naisr_viewer.views.dialogs.export import ExportDialog
from naisr_viewer.views.dialogs.files import (
    ask_curve_place,
    ask_image_path,
    ask_open_path,
    ask_scan_path,
    ask_session_path,
    ask_session_place,
    dropped,
    is_atlas,
    is_scan,
    is_session,
)
from naisr_viewer.views.dialogs.instead import ask_instead
from naisr_viewer.views.dialogs.keys import KeysSheet
from naisr_viewer.views.dialogs.label import ask_label
from naisr_viewer.views.dialogs.preferences import ask_preferences
from naisr_viewer.views.dialogs.question import ask
from naisr_viewer.views.focus import FocusRest, in_order
from naisr_viewer.views.patients.panel import PatientPanel
from naisr_viewer.views.recent_menu import RecentMenu
from naisr_viewer.views.shapes.shape_view import ShapeView
from naisr_viewer.views.status_bar import StatusBar
from naisr_viewer.views.style_sheet import style_sheet
from naisr_viewer.views.theme import palette, resolved
from naisr_viewer.words.matrix import heads
from naisr_viewer.words.numbers import in_words
from naisr_viewer.words.readout import number, readout

if TYPE_CHECKING:
    from naisr_viewer.views.shapes.sub_plot import Hit

TITLE = "NAISR Atlas Explorer"
FIRST_SIZE = QSize(1280, 800)


class MainWindow(QMainWindow):
    """Shows a state; every user act leaves as a signal.

    It is long because it is the one door to all that is seen: a setter for each thing shown, a question for
    each thing asked; what they do is in the widgets.
    """

    open_requested = Signal(Path)  # an atlas was chosen, dropped or picked from the recent ones
    scan_requested = Signal(Path)  # a patient's file was chosen or dropped
    reading_requested = Signal(
        object
    )  # a Reading: a patient's file and how to read it, from the command line
    session_requested = Signal(Path)  # a session was chosen or dropped
    session_place_chosen = Signal(Path)  # where the session shall go
    going_on_requested = Signal()  # File > Go on where you left
    export_requested = Signal(object)  # an ExportChoice from the dialog, of surfaces
    figure_requested = Signal(object)  # one of the matrix with its figure
    screenshot_requested = Signal(Path)  # where the picture shall go
    undo_requested = Signal()  # Edit > Undo
    redo_requested = Signal()  # Edit > Redo
    layout_requested = Signal(object)  # a Layout from the View menu or the toolbar
    matrix_requested = Signal(object)  # a Matrix from the boxes above its cells
    quantity_chosen = Signal(object)  # a Quantity that the surfaces shall be coloured by
    shared_toggled = Signal(bool)  # whether all surfaces with numbers of one unit share its scale
    section_switched = Signal()  # View > Section plane
    section_chosen = Signal(object)  # a Plane from the box above the shapes
    section_moved = Signal(float)  # where the section plane is dragged to, mm along its normal
    section_settled = Signal(float)  # where it came to rest
    section_flipped = Signal()  # the other side of it shall be shown
    picture_copy_requested = Signal()  # Edit > Copy picture
    table_copy_requested = Signal()  # Edit > Copy table
    edges_switched = Signal()  # View > Triangles
    unpin_requested = Signal()  # Edit > Remove pins
    play_requested = Signal()  # View > Play: whether it plays is for who moves the covariate to say
    pin_removal_requested = Signal(int)  # number of a pin whose cross was clicked
    drawer_requested = Signal(object)  # a Tab of the drawer, or None to close it
    curve_requested = Signal(object)  # a CurveChoice: another measure, or along another covariate
    curve_place_chosen = Signal(Path)  # where the curve shall go
    reckoning_requested = Signal(bool)  # whether it shall be worked out what is usual, or that be stopped
    theme_requested = Signal(object)  # a ThemeChoice from the View menu
    cancel_requested = Signal()  # the cancel button beside the progress bar
    about_requested = Signal()  # Help > About
    preferences_requested = Signal()  # Edit > Preferences…
    close_requested = Signal(object)  # a QCloseEvent; who ignores it keeps the window open
    closing = Signal()  # the window is about to close
    appeared = Signal()  # the window has just been painted for the first time

    def __init__(self) -> None:
        super().__init__()
        self.setWindowTitle(TITLE)
        self.resize(FIRST_SIZE)
        self.setAcceptDrops(True)
        self._theme_choice = ThemeChoice.SYSTEM
        self._has_appeared = False
        self._documents: DocumentWindow | None = None
        self._keys: KeysSheet | None = None
        self._focus = FocusRest(self)
        self._is_editable, self._can_undo, self._can_redo, self._can_go_on = True, False, False, False
        self.covariates = CovariatePanel(self)
        self.shapes = ShapeView(self)
        self.patients = PatientPanel(self)
        self._centre = Centre(self.shapes, self)
        self._below = StatusBar(self)
        self._recent = RecentMenu(self)
        self.error_text = self._centre.errors.text
        self.status, self.scale = self._below.text, self._below.scale
        self.progress, self.cancel = self._below.progress, self._below.cancel
        self._state = ExplorerState()
        self._actions = make_actions(COMMANDS, self, self)
        self._compose()
        self._connect()
        self.show_theme(ThemeChoice.SYSTEM)
        self.show_state(self._state)

    def show_state(self, state: ExplorerState) -> None:
        """Bring the window to ``state``, touching only what changed."""
        old, self._state = self._state, state
        if state.atlas is not None and state.atlas is not old.atlas:
            theme = resolved(self._theme_choice)
            self.covariates.show_atlas(state.atlas, theme)
            self.shapes.show_atlas(state.atlas, theme)
            self.setWindowTitle(f"{state.atlas.name} — {TITLE}")
            self.scale.show_unit(state.atlas.frame.unit)
            self._centre.maps.show_unit(state.atlas.frame.unit)
            offer(COMMANDS, self._actions, state.atlas)
            self._centre.drawer.offer(tabs_of(state.atlas))
            in_order(self._stops)
        self._centre.show_shapes(state.atlas is not None)
        if state.is_atlas_changed != old.is_atlas_changed:  # what was put off stays so
            name = state.atlas.path.name if state.atlas and state.is_atlas_changed else ""
            self._centre.changed.show_changed(name)
        self._centre.drawer.show_tab(state.drawer)
        self._centre.curve.show_state(state)
        self.scale.setVisible(state.atlas is not None)
        self.covariates.show_values(state)
        self.patients.show_state(state)
        if len(state.patients) > len(old.patients):
            self._actions["patients"].setChecked(True)
        self.show_sides()
        self._centre.section.show_section(state.section)
        self.shapes.show_edges(state.has_edges)
        self._actions["edges"].setChecked(state.has_edges)
        self._actions["section"].setChecked(state.section is not None)
        self._show_maps(state)
        self._show_panels(state)
        self._show_ghost(state)
        self._actions[f"layout {state.layout}"].setChecked(True)
        for tab in Tab:
            self._actions[f"drawer {tab}"].setChecked(tab is state.drawer)
        self._enable()

    def show_sides(self) -> None:
        """Show the panels beside the shapes, that of the patients where it is switched on."""
        is_open = self._state.atlas is not None
        self.covariates.setVisible(is_open)
        self.patients.setVisible(is_open and self._actions["patients"].isChecked())

    def _show_panels(self, state: ExplorerState) -> None:
        """The sub-plots of the layout, and what stands around the cells of the matrix."""
        matrix = state.matrix if state.layout is Layout.MATRIX else None
        self._centre.matrix.show_matrix(matrix, state.atlas)
        if matrix is None or state.atlas is None:
            self.shapes.show_panels(visible_panels(state))
            self.shapes.outline(None)
        else:
            self.shapes.show_panels(visible_panels(state), heads(state.atlas, matrix))
            self.shapes.show_colours(cell_colours(state))
            self.shapes.outline(here(state))

    def _show_maps(self, state: ExplorerState) -> None:
        """What the surfaces are coloured by; those of the matrix are plain."""
        bar, is_matrix = self._centre.maps, state.layout is Layout.MATRIX
        bar.setVisible(state.atlas is not None and can_map(state.atlas) and not is_matrix)
        bar.show_overlay(state.overlay, words_of_maps(state))
        self.shapes.show_scales({panel: scale_of(state, panel) for panel in visible_panels(state)})

    def _show_ghost(self, state: ExplorerState) -> None:
        scan = state.shown.scan if state.shown and state.has_ghost else None
        if scan is None:
            self.shapes.show_ghost(None)
        else:
            self.shapes.show_ghost(scan.points_mm, scan.faces)

    @property
    def _stops(self) -> list[QWidget]:
        """What the Tab key goes through, as it is read: the panels from left to right, then what is below."""
        shapes = [*self._centre.stops, self.shapes, self.shapes.row_bar, *self._centre.drawer_stops]
        return [*self.covariates.stops, *shapes, *self.patients.stops, self.cancel]

    def show_reach(self, section: Section, low_mm: float, high_mm: float) -> None:
        """Say between which offsets the section plane has something to cut."""
        self._centre.section.show_reach(low_mm, high_mm)
        self._centre.section.show_section(section)

    def show_history(self, can_undo: bool, can_redo: bool) -> None:
        """Enable what can be undone and redone."""
        self._can_undo, self._can_redo = can_undo, can_redo
        self._enable()

    def show_playing(self, covariate: str) -> None:
        """Which covariate moves by itself, by its name; empty for none."""
        self._actions["play"].setChecked(bool(covariate))
        for name, row in self.covariates.rows.items():
            row.show_playing(name == covariate)

    def show_left(self, can_go_on: bool) -> None:
        """Whether there is a session of an earlier run to go on with."""
        self._can_go_on = can_go_on
        self._enable()

    def show_ledger(self, ledger: Ledger | None) -> None:
        """Mark the pinned places on the shapes and tell what moved them; None takes all of it away."""
        self._centre.ledger.show_ledger(ledger, self._state.atlas)
        places = () if ledger is None else ledger.places
        self.shapes.show_marks(
            {panel: [(point, pin_colour(number)) for number, point in found] for panel, found in places}
        )

    def show_curves(self, curves: Curves | None, is_measuring: bool = False, trouble: str = "") -> None:
        """Show how measures change along a covariate, see :meth:`CurvePage.show_curves`."""
        self._centre.curve.show_curves(curves, is_measuring, trouble)

    def show_reckoning(self, reckoning: Reckoning) -> None:
        """Say how far it is known what is usual among the people of the atlas."""
        self._centre.curve.show_reckoning(reckoning)

    def show_standings(self, standings: Sequence[Standing]) -> None:
        """Say where the measures of the patient that is shown stand among people; none takes that away."""
        self.patients.show_standings(standings)

    def curve_picture(self) -> bytes:
        """The curve that is shown as SVG; there is one."""
        return self._centre.curve.picture()

    def forget_moves(self) -> None:
        """Say no more of movements that have not come to rest."""
        self.covariates.forget_moves()
        self._centre.curve.forget_move()

    def show_recent(self, paths: Sequence[Path]) -> None:
        """Fill File > Open recent."""
        self._recent.show_files(paths)

    def show_theme(self, choice: ThemeChoice) -> None:
        """Colour everything."""
        self._theme_choice = choice
        theme = resolved(choice)
        QApplication.setPalette(palette(theme))
        self.setStyleSheet(style_sheet(theme))
        self.covariates.set_theme(theme)
        self.shapes.set_theme(theme)
        self._centre.ledger.set_theme(theme)
        self._centre.curve.set_theme(theme)
        self._centre.section.set_theme(theme)
        self.scale.update()
        self._actions[f"theme {choice}"].setChecked(True)

    def show_status(self, text: str) -> None:
        """The one line at the bottom left."""
        self.status.setText(text)

    def show_opening(self, name: str) -> None:
        """Say on the empty page that a file is being opened; an empty name invites to open one."""
        self._centre.empty.show_opening(name)

    def show_progress(self, fraction: float | None) -> None:
        """The bar and its cancel button at the bottom right; None hides them, at 0 it only says: busy."""
        self._below.show_progress(fraction)
        self._enable()

    def show_error(self, message: str) -> None:
        """Say what went wrong above the shapes until it is dismissed; an empty message hides it."""
        self._centre.errors.show_message(message)

    def show_about(self, version: str) -> None:
        """Say what this program is, until it is dismissed."""
        about(self, version)

    def show_about_atlas(self) -> None:
        """Say who is behind the atlas that is open, until it is dismissed."""
        if self._state.atlas is not None:
            tell_of_atlas(self, self._state.atlas)

    def show_keys(self) -> None:
        """Open the sheet of keys and mouse, or bring it to the front."""
        self._keys = self._keys or KeysSheet(self)
        self._keys.show()
        self._keys.raise_()

    def open_example(self, name: str) -> None:
        """Open one of the atlases that come with the program."""
        try:
            self.open_requested.emit(shipped_atlas(name))
        except InputError as error:
            self.show_error(in_words(error))

    def show_document(self, page: str) -> None:
        """Open one of the documents that come with the program, in the window that shows one already."""
        self._documents = self._documents or DocumentWindow(shipped("docs"), self)
        self._documents.show_page(page)

    def set_editable(self, editable: bool) -> None:
        """Whether covariates and patients can be changed just now; what would end the work rests, too."""
        focused = self.focusWidget()
        self.covariates.setEnabled(editable)
        self.patients.set_editable(editable)
        self._is_editable = editable
        self._enable()
        if editable:
            self._focus.end()
        else:
            self._focus.begin(focused)

    def _enable(self) -> None:
        """Enable the commands that make sense."""
        is_calm = self.cancel.isHidden()
        past = self._can_undo, self._can_redo, self._can_go_on
        so = facts(self._state, self._is_editable, is_calm, *past)
        enable(COMMANDS, self._actions, so)

    def ask_atlas(self) -> None:
        """Let an atlas be chosen and opened."""
        path = ask_open_path(self)
        if path is not None and is_scan(path):
            if ask_instead(self, path, "scan"):
                self.scan_requested.emit(path)
        elif path is not None:
            self.open_requested.emit(path)

    def _ask_again(self) -> None:
        """Have the atlas opened that is open."""
        if self._state.atlas is not None:
            self.open_requested.emit(self._state.atlas.path)

    def ask_scan(self) -> None:
        """Let a patient's file be chosen and opened."""
        path = ask_scan_path(self, self._state.atlas)
        if path is not None and is_atlas(path):
            if ask_instead(self, path, "atlas"):
                self.open_requested.emit(path)
        elif path is not None:
            self.scan_requested.emit(path)

    def ask_export(self) -> None:
        """Let surfaces be chosen and written."""
        assert self._state.atlas is not None
        choice = ExportDialog(self._state, self).ask()
        if choice is not None and choice.figure:
            self.figure_requested.emit(replace(choice, camera=self.shapes.camera or choice.camera))
        elif choice is not None:
            self.export_requested.emit(choice)

    def ask_session(self) -> None:
        """Let a session be chosen and opened."""
        path = ask_session_path(self)
        if path is not None:
            self.session_requested.emit(path)

    def ask_session_place(self) -> None:
        """Let a place be chosen for the session."""
        path = ask_session_place(self, self._state)
        if path is not None:
            self.session_place_chosen.emit(path)

    def _ask_curve_place(self, ending: str) -> None:
        """Let a place be chosen for the curve."""
        path = ask_curve_place(self, self._state, ending)
        if path is not None:
            self.curve_place_chosen.emit(path)

    def ask_screenshot(self) -> None:
        """Let a place be chosen for a picture."""
        path = ask_image_path(self, self._state)
        if path is not None:
            self.screenshot_requested.emit(path)

    def ask(self, question: Question, text: str, detail: str) -> Answer:
        """Whether something shall be done that cannot be undone."""
        return ask(self, question, text, detail)

    def ask_preferences(self, asked: Mapping[Question, bool]) -> dict[Question, bool] | None:
        """Which questions shall be asked; None when nothing shall change."""
        return ask_preferences(self, asked)

    def ask_label(self, labels: Labels) -> int | str | None:
        """Which label of a volume; None when nobody chose."""
        return ask_label(self, labels)

    def grab_image(self) -> QImage:
        """The whole window as a picture, with all that it will have in a moment."""
        self._prepare_charts()
        self.shapes.grab()  # only what is drawn tells the scale bar how long a millimetre is
        return self.grab().toImage()

    def closeEvent(self, event: QCloseEvent) -> None:
        """Unless it shall stay open, let the controller stop its work and release what draws the shapes."""
        self.close_requested.emit(event)
        if not event.isAccepted():
            return
        self.closing.emit()
        self.shapes.clear()
        super().closeEvent(event)

    def paintEvent(self, event: QPaintEvent) -> None:
        """Tell when the window is on the screen, so that what takes long can start behind it."""
        super().paintEvent(event)
        if not self._has_appeared:
            self._has_appeared = True
            QTimer.singleShot(0, self, self.appeared.emit)

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        """Take files."""
        if dropped(event.mimeData()):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        """Open what was dropped: atlases and sessions by their endings, all others as scans."""
        if files := dropped(event.mimeData()):
            event.acceptProposedAction()
        for file in files:
            chosen = (is_atlas, self.open_requested), (is_session, self.session_requested)
            next((signal for is_one, signal in chosen if is_one(file)), self.scan_requested).emit(file)

    def _compose(self) -> None:
        body = QWidget(self)
        body.setFocusPolicy(Qt.FocusPolicy.ClickFocus)  # a click on the shapes ends what is typed elsewhere
        row = QHBoxLayout(body)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(0)
        row.addWidget(self.covariates)
        row.addWidget(self._centre)
        row.addWidget(self.patients)
        self.setCentralWidget(body)
        self.setStatusBar(self._below)
        examples = QMenu("Examples", self)
        fill(examples, [command.name for command in EXAMPLES], self._actions)
        menus = {RECENT: self._recent, EXAMPLE: examples}
        entries = {**self._actions, **{name: menu.menuAction() for name, menu in menus.items()}}
        for title, names in MENUS.items():
            fill(self.menuBar().addMenu(title), names, entries)
        self.addToolBar(make_toolbar(self._actions, self))

    def _connect(self) -> None:
        self._recent.file_chosen.connect(self.open_requested)
        self._centre.empty.open_requested.connect(self.ask_atlas)
        self._centre.changed.reopen_requested.connect(self._ask_again)
        self._centre.maps.quantity_chosen.connect(self.quantity_chosen)
        self._centre.maps.shared_toggled.connect(self.shared_toggled)
        self._centre.drawer.tab_requested.connect(self.drawer_requested)
        self._centre.ledger.removal_requested.connect(self.pin_removal_requested)
        self._centre.matrix.changed.connect(self.matrix_requested)
        self._connect_curve()
        self._connect_section()
        self.patients.open_requested.connect(self.ask_scan)
        self.cancel.clicked.connect(self.cancel_requested)
        self.shapes.scale_changed.connect(self.scale.set_scale)
        self.shapes.hovered.connect(self._show_readout)
        self.shapes.left.connect(lambda: self._below.show_readout(""))
        # Queued, so that the picture has reached the screen before charts are made.
        self.shapes.drawn.connect(self._prepare_charts, Qt.ConnectionType.QueuedConnection)
        QGuiApplication.styleHints().colorSchemeChanged.connect(self._system_theme_changed)

    def _connect_curve(self) -> None:
        curve = self._centre.curve
        curve.choice_requested.connect(self.curve_requested)
        curve.value_moved.connect(self.covariates.value_moved)  # dragging its line is dragging the slider
        curve.value_settled.connect(self.covariates.value_settled)
        curve.save_requested.connect(self._ask_curve_place)
        curve.reckoning_requested.connect(self.reckoning_requested)

    def _connect_section(self) -> None:
        bar = self._centre.section
        bar.plane_chosen.connect(self.section_chosen)
        bar.offset_moved.connect(self.section_moved)
        bar.offset_settled.connect(self.section_settled)
        bar.flip_requested.connect(self.section_flipped)

    def _show_readout(self, panel: Panel, hit: Hit) -> None:
        """What the mouse rests over."""
        scale, atlas = scale_of(self._state, panel), self._state.atlas
        assert atlas is not None
        told = ""
        if hit.value is not None and scale is not None:
            told = number(hit.value, scale.unit, scale.scale == "signed")
        self._below.show_readout(
            readout(title_of(panel), hit.point_mm[: atlas.frame.dim], told, atlas.frame.unit)
        )

    def _prepare_charts(self) -> None:
        """Once, after the first picture."""
        if self.covariates.support.chart is None:
            self.covariates.support.prepare()
            self._centre.curve.prepare()
            in_order(self._stops)

    def _system_theme_changed(self) -> None:
        if self._theme_choice is ThemeChoice.SYSTEM:
            self.show_theme(ThemeChoice.SYSTEM)
