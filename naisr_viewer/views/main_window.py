"""The window: covariates on the left, shapes in the centre, patients on the right, what goes on below."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TypeVar

from PySide6.QtCore import QSize, Qt, QTimer, Signal
from PySide6.QtGui import (
    QAction,
    QActionGroup,
    QCloseEvent,
    QDragEnterEvent,
    QDropEvent,
    QGuiApplication,
    QImage,
    QKeySequence,
    QPaintEvent,
)
from PySide6.QtWidgets import (
    QApplication,
    QFrame,
    QHBoxLayout,
    QLabel,
    QMainWindow,
    QMenu,
    QProgressBar,
    QPushButton,
    QStackedWidget,
    QToolBar,
    QVBoxLayout,
    QWidget,
)

from naisr_viewer.state.explorer import OF_A_PATIENT, ExplorerState, Layout, visible_panels
from naisr_viewer.state.patients import Labels
from naisr_viewer.state.theme import ThemeChoice
from naisr_viewer.views.covariates.panel import CovariatePanel
from naisr_viewer.views.dialogs.about import about
from naisr_viewer.views.dialogs.export import ExportDialog
from naisr_viewer.views.dialogs.files import ask_image_path, ask_open_path, ask_scan_path
from naisr_viewer.views.dialogs.label import ask_label
from naisr_viewer.views.empty_page import EmptyPage
from naisr_viewer.views.patients.panel import PatientPanel
from naisr_viewer.views.shapes.camera import DIRECTIONS
from naisr_viewer.views.shapes.scale_bar import ScaleBar
from naisr_viewer.views.shapes.shape_view import ShapeView
from naisr_viewer.views.style_sheet import style_sheet
from naisr_viewer.views.theme import palette, resolved

TITLE = "NAISR Atlas Explorer"
FIRST_SIZE = QSize(1280, 800)
ATLAS_ENDING = ".safetensors"

Choice = TypeVar("Choice")


class MainWindow(QMainWindow):
    """Shows a state; every user act leaves as a signal."""

    open_requested = Signal(Path)  # an atlas was chosen, dropped or picked from the recent ones
    scan_requested = Signal(Path)  # a patient's file was chosen or dropped
    export_requested = Signal(object)  # an ExportChoice from the dialog
    screenshot_requested = Signal(Path)  # where the picture shall go
    undo_requested = Signal()  # Edit > Undo
    redo_requested = Signal()  # Edit > Redo
    layout_requested = Signal(object)  # a Layout from the View menu or the toolbar
    theme_requested = Signal(object)  # a ThemeChoice from the View menu
    cancel_requested = Signal()  # the cancel button beside the progress bar
    about_requested = Signal()  # Help > About
    closing = Signal()  # the window is about to close
    appeared = Signal()  # the window has just been painted for the first time

    def __init__(self) -> None:
        super().__init__()
        self.setWindowTitle(TITLE)
        self.resize(FIRST_SIZE)
        self.setAcceptDrops(True)
        self._theme_choice = ThemeChoice.SYSTEM
        self._has_appeared = False
        self._is_editable, self._can_undo, self._can_redo = True, False, False
        self.covariates = CovariatePanel(self)
        self.shapes = ShapeView(self)
        self.patients = PatientPanel(self)
        self._state = ExplorerState()
        self._make_body()
        self._make_status()
        self._make_actions()
        self._make_menus()
        self._make_toolbar()
        QGuiApplication.styleHints().colorSchemeChanged.connect(self._system_theme_changed)
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
        self._centre.setCurrentIndex(0 if state.atlas is None else 1)
        self.scale.setVisible(state.atlas is not None)
        self.covariates.setVisible(state.atlas is not None)
        self.covariates.show_values(state)
        self.patients.show_state(state)
        if len(state.patients) > len(old.patients):
            self._patients_action.setChecked(True)
        self.patients.setVisible(self._patients_action.isChecked() and state.atlas is not None)
        self.shapes.show_panels(visible_panels(state))
        self._show_ghost(state)
        self._layouts[state.layout].setChecked(True)
        self._enable()

    def _show_ghost(self, state: ExplorerState) -> None:
        scan = state.shown.scan if state.shown and state.has_ghost else None
        if scan is None:
            self.shapes.show_ghost(None)
        else:
            self.shapes.show_ghost(scan.points_mm, scan.faces)

    def show_history(self, can_undo: bool, can_redo: bool) -> None:
        """Enable what can be undone and redone."""
        self._can_undo, self._can_redo = can_undo, can_redo
        self._enable()

    def show_recent(self, paths: Sequence[Path]) -> None:
        """Fill File > Open recent."""
        self._recent.clear()
        self._recent.setEnabled(bool(paths))
        for path in paths:
            action = self._recent.addAction(f"{path.name}   {path.parent}")
            action.triggered.connect(lambda _, path=path: self.open_requested.emit(path))

    def show_theme(self, choice: ThemeChoice) -> None:
        """Colour everything."""
        self._theme_choice = choice
        theme = resolved(choice)
        QApplication.setPalette(palette(theme))
        self.setStyleSheet(style_sheet(theme))
        self.covariates.set_theme(theme)
        self.shapes.set_theme(theme)
        self.scale.update()
        self._themes[choice].setChecked(True)

    def show_status(self, text: str) -> None:
        """The one line at the bottom left."""
        self.status.setText(text)

    def show_opening(self, name: str) -> None:
        """Say on the empty page that a file is being opened; an empty name invites to open one."""
        self._empty.show_opening(name)

    def show_progress(self, fraction: float | None) -> None:
        """The bar and its cancel button at the bottom right; None hides them, at 0 it only says: busy."""
        self.progress.setMaximum(1000 if fraction else 0)
        self.progress.setVisible(fraction is not None)
        self.cancel.setVisible(fraction is not None)
        self.progress.setValue(round(1000 * (fraction or 0.0)))

    def show_error(self, message: str) -> None:
        """Say what went wrong above the shapes until it is dismissed; an empty message hides it."""
        self.error_text.setText(message)
        self._error_bar.setVisible(bool(message))

    def show_about(self, version: str) -> None:
        """Say what this program is, until it is dismissed."""
        about(self, version)

    def set_editable(self, editable: bool) -> None:
        """Whether covariates and patients can be changed just now; what would end the work rests, too."""
        self.covariates.setEnabled(editable)
        self.patients.set_editable(editable)
        self._is_editable = editable
        self._enable()

    def _enable(self) -> None:
        """Enable the actions that make sense."""
        is_open, is_editable = self._state.atlas is not None, self._is_editable
        for action in self._needs_atlas:
            action.setEnabled(is_open)
        for action in self._needs_rest:
            action.setEnabled(is_open and is_editable)
        for layout in OF_A_PATIENT:
            self._layouts[layout].setEnabled(self._state.fit is not None)
        self._undo.setEnabled(self._can_undo and is_editable)
        self._redo.setEnabled(self._can_redo and is_editable)

    def ask_label(self, labels: Labels) -> int | None:
        """Which label of a volume; None when nobody chose."""
        return ask_label(self, labels)

    def grab_image(self) -> QImage:
        """The whole window as a picture."""
        return self.grab().toImage()

    def closeEvent(self, event: QCloseEvent) -> None:
        """Let the controller stop its work, then release what draws the shapes."""
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
        if any(url.isLocalFile() for url in event.mimeData().urls()):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        """Open what was dropped: an atlas by its ending, all others as scans."""
        files = [Path(url.toLocalFile()) for url in event.mimeData().urls() if url.isLocalFile()]
        if files:
            event.acceptProposedAction()
        for file in files:
            is_atlas = file.suffix.lower() == ATLAS_ENDING
            (self.open_requested if is_atlas else self.scan_requested).emit(file)

    def _make_body(self) -> None:
        self._error_bar = QFrame(self)
        self._error_bar.setObjectName("errorBar")
        self.error_text = QLabel(self._error_bar)
        self.error_text.setWordWrap(True)
        self.error_text.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        dismiss = QPushButton("Dismiss", self._error_bar)
        dismiss.clicked.connect(lambda: self.show_error(""))
        bar = QHBoxLayout(self._error_bar)
        bar.setContentsMargins(16, 8, 12, 8)
        bar.addWidget(self.error_text, 1)
        bar.addWidget(dismiss)
        self._error_bar.hide()
        self._centre = QStackedWidget(self)
        self._empty = EmptyPage(self)
        self._empty.open_requested.connect(self._open)
        self._centre.addWidget(self._empty)
        self._centre.addWidget(self.shapes)
        right = QVBoxLayout()
        right.setSpacing(0)
        right.addWidget(self._error_bar)
        right.addWidget(self._centre, 1)
        body = QWidget(self)
        row = QHBoxLayout(body)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(0)
        row.addWidget(self.covariates)
        row.addLayout(right, 1)
        row.addWidget(self.patients)
        self.patients.open_requested.connect(self._open_scan)
        self.setCentralWidget(body)

    def _make_status(self) -> None:
        bar = self.statusBar()
        bar.setSizeGripEnabled(False)
        bar.setMinimumHeight(34)
        self.status = QLabel(self)
        self.status.setObjectName("status")
        self.progress = QProgressBar(self)
        self.progress.setRange(0, 1000)
        self.progress.setTextVisible(False)
        self.progress.setFixedWidth(180)
        self.cancel = QPushButton("Cancel", self)
        self.cancel.setToolTip("Stop the computation and keep what is on screen (Esc)")
        self.cancel.setShortcut(QKeySequence(Qt.Key.Key_Escape))
        self.cancel.clicked.connect(self.cancel_requested)
        bar.addWidget(self.status, 1)
        self.scale = ScaleBar(self)
        self.shapes.scale_changed.connect(self.scale.set_scale)
        for widget in (self.progress, self.cancel, self.scale):
            bar.addPermanentWidget(widget)
        self.show_progress(None)

    def _action(self, text: str, act: Callable[[], object], keys: str = "", tip: str = "") -> QAction:
        action = QAction(text, self)
        action.triggered.connect(lambda _=False: act())
        action.setShortcut(QKeySequence(keys))
        action.setToolTip(f"{tip or text.rstrip('…')} ({keys})" if keys else tip)
        return action

    def _make_actions(self) -> None:
        self._open_action = self._action("Open atlas…", self._open, "Ctrl+O", "Open another atlas")
        self._scan_action = self._action(
            "Open scan…", self._open_scan, "Ctrl+Shift+O", "Open a patient's shape to fit the atlas to it"
        )
        self._export = self._action("Export…", self._ask_export, "Ctrl+E", "Write surfaces to files")
        self._screenshot = self._action(
            "Screenshot…", self._ask_screenshot, "Ctrl+S", "Save a picture of the window"
        )
        self._quit = self._action("Quit", self.close, "Ctrl+Q")
        self._undo = self._action(
            "Undo", self.undo_requested.emit, "Ctrl+Z", "Undo the last change of a covariate"
        )
        self._redo = self._action("Redo", self.redo_requested.emit, "Ctrl+Shift+Z", "Redo what was undone")
        self._reset = self._action("Reset all covariates", self.covariates.reset_all_requested.emit, "Ctrl+R")
        self._camera = self._action("Reset camera", self.shapes.reset_camera, "Ctrl+0", "Frame the shapes")
        self._layouts = self._choices(
            {
                Layout.SIDE_BY_SIDE: ("Side by side", "Ctrl+1"),
                Layout.FULL_SHAPE: ("Full shape", "Ctrl+2"),
                Layout.FIT: ("Fit", "Ctrl+3"),
                Layout.CHANGE: ("Before and after", "Ctrl+4"),
            },
            self.layout_requested.emit,
        )
        self._patients_action = self._action("Patients", self._toggle_patients, "Ctrl+P", "Show the patients")
        self._patients_action.setCheckable(True)
        themes = {choice: (f"{choice.value.capitalize()} theme", "") for choice in ThemeChoice}
        self._themes = self._choices(themes, self.theme_requested.emit)
        self._needs_atlas = [
            self._screenshot,
            self._camera,
            self._patients_action,
            *self._layouts.values(),
        ]
        self._needs_rest = [self._scan_action, self._export, self._reset]

    def _choices(
        self, options: Mapping[Choice, tuple[str, str]], choose: Callable[[Choice], object]
    ) -> dict[Choice, QAction]:
        group = QActionGroup(self)
        actions = {}
        for choice, (text, keys) in options.items():
            actions[choice] = self._action(text, partial(choose, choice), keys)
            actions[choice].setCheckable(True)
            group.addAction(actions[choice])
        return actions

    def _make_menus(self) -> None:
        bar = self.menuBar()
        file = bar.addMenu("&File")
        file.addActions([self._open_action, self._scan_action])
        self._recent = QMenu("Open recent", self)
        file.addMenu(self._recent)
        file.addSeparator()
        file.addActions([self._export, self._screenshot])
        file.addSeparator()
        file.addAction(self._quit)
        bar.addMenu("&Edit").addActions([self._undo, self._redo, self._reset])
        view = bar.addMenu("&View")
        view.addActions(list(self._layouts.values()))
        view.addAction(self._patients_action)
        view.addSeparator()
        view.addAction(self._camera)
        for number, direction in enumerate(DIRECTIONS, start=1):
            act = partial(self.shapes.look_from, direction)
            look = self._action(f"From {direction}", act, f"Alt+{number}")
            self._needs_atlas.append(look)
            view.addAction(look)
        view.addSeparator()
        view.addActions(list(self._themes.values()))
        bar.addMenu("&Help").addAction(self._action("About", self.about_requested.emit))

    def _make_toolbar(self) -> None:
        bar = QToolBar("Main", self)
        bar.setMovable(False)
        bar.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextOnly)
        bar.setContextMenuPolicy(Qt.ContextMenuPolicy.PreventContextMenu)
        bar.addActions([self._open_action, self._scan_action, self._export, self._screenshot])
        bar.addSeparator()
        bar.addActions(list(self._layouts.values()))
        bar.addSeparator()
        bar.addActions([self._undo, self._redo, self._camera])
        self.addToolBar(bar)

    def _open(self) -> None:
        path = ask_open_path(self)
        if path is not None:
            self.open_requested.emit(path)

    def _open_scan(self) -> None:
        path = ask_scan_path(self)
        if path is not None:
            self.scan_requested.emit(path)

    def _toggle_patients(self) -> None:
        self.show_state(self._state)

    def _ask_export(self) -> None:
        assert self._state.atlas is not None
        choice = ExportDialog(self._state.atlas, self).ask()
        if choice is not None:
            self.export_requested.emit(choice)

    def _ask_screenshot(self) -> None:
        path = ask_image_path(self, self._state)
        if path is not None:
            self.screenshot_requested.emit(path)

    def _system_theme_changed(self) -> None:
        if self._theme_choice is ThemeChoice.SYSTEM:
            self.show_theme(ThemeChoice.SYSTEM)
