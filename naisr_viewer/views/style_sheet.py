"""A theme for the parts that a palette does not reach."""

from __future__ import annotations

from naisr_viewer.views.theme import Theme


def style_sheet(theme: Theme) -> str:
    """``theme`` for the parts that the palette does not reach."""
    t = theme
    return f"""
    QWidget {{ font-size: 10pt; }}
    QToolTip {{ background: {t.raised}; color: {t.text}; border: 1px solid {t.line}; padding: 4px; }}
    QMenuBar {{ background: {t.window}; border-bottom: 1px solid {t.line}; }}
    QMenuBar::item {{ padding: 5px 10px; background: transparent; }}
    QMenuBar::item:selected {{ background: {t.line}; border-radius: 4px; }}
    QMenu {{ background: {t.raised}; border: 1px solid {t.line}; padding: 4px; }}
    QMenu::item {{ padding: 5px 28px 5px 24px; border-radius: 4px; }}
    QMenu::item:selected {{ background: {t.accent}; color: {t.on_accent}; }}
    QMenu::item:disabled {{ color: {t.muted}; }}
    QMenu::separator {{ height: 1px; background: {t.line}; margin: 4px 8px; }}
    QToolBar {{ background: {t.window}; border: none; border-bottom: 1px solid {t.line};
                padding: 4px 8px; spacing: 6px; }}
    QToolBar::separator {{ width: 1px; background: {t.line}; margin: 4px 6px; }}
    QPushButton, QToolBar QToolButton {{ background: {t.raised}; border: 1px solid {t.line};
                border-radius: 5px; padding: 4px 12px; color: {t.text}; }}
    QPushButton:hover, QToolBar QToolButton:hover {{ border-color: {t.accent}; }}
    QPushButton:pressed, QToolBar QToolButton:pressed {{ background: {t.line}; }}
    QPushButton:checked, QToolBar QToolButton:checked {{ background: {t.accent}; color: {t.on_accent};
                border-color: {t.accent}; }}
    QPushButton:default {{ border-color: {t.accent}; }}
    QPushButton:disabled, QToolBar QToolButton:disabled {{ color: {t.muted}; background: {t.window}; }}
    QToolBar #qt_toolbar_ext_button {{ padding: 4px 0; font-weight: 600; }}
    QToolBar QToolButton:checked:disabled {{ color: {t.muted}; background: {t.line};
                border-color: {t.line}; }}
    QPushButton:focus {{ border-color: {t.accent}; }}
    QLineEdit {{ background: {t.raised}; border: 1px solid {t.line};
                border-radius: 5px; padding: 3px 6px; color: {t.text};
                selection-background-color: {t.accent}; }}
    QLineEdit:focus {{ border-color: {t.accent}; }}
    QLineEdit[isWrong="true"] {{ background: {t.error}; color: {t.on_error}; border-color: {t.on_error}; }}
    QStatusBar {{ background: {t.window}; border-top: 1px solid {t.line}; }}
    QStatusBar::item {{ border: none; }}
    QProgressBar {{ background: {t.line}; border: none; border-radius: 3px; max-height: 6px; }}
    QProgressBar::chunk {{ background: {t.accent}; border-radius: 3px; }}
    #sidebar, #patientBar {{ background: {t.window}; border: none; }}
    QScrollArea {{ background: {t.window}; border: 1px solid transparent; }}
    QScrollArea:focus {{ border-color: {t.accent}; }}
    QCheckBox {{ border: 1px solid transparent; border-radius: 3px; }}
    QCheckBox:focus {{ border-color: {t.accent}; }}
    QToolButton:focus {{ border: 1px solid {t.accent}; border-radius: 4px; }}
    QPushButton:checked:focus {{ border: 2px solid {t.text}; }}
    #sidebar {{ border-right: 1px solid {t.line}; }}
    #patientBar {{ border-left: 1px solid {t.line}; }}
    #patientList {{ background: {t.raised}; border: 1px solid {t.line}; border-radius: 5px; padding: 2px;
                outline: none; }}
    #patientList:focus {{ border-color: {t.accent}; }}
    #patientList::item {{ border-left: 3px solid transparent; border-radius: 3px; }}
    #patientList::item:hover {{ background: {t.window}; }}
    #patientList::item:selected {{ background: {t.line}; border-left-color: {t.accent}; color: {t.text}; }}
    QScrollBar:vertical {{ background: transparent; width: 10px; margin: 0; }}
    QScrollBar::handle:vertical {{ background: {t.line}; border-radius: 3px; margin: 2px;
                min-height: 32px; }}
    QScrollBar::handle:vertical:hover {{ background: {t.muted}; }}
    QScrollBar:vertical:focus {{ background: {t.accent}; }}
    QScrollBar::add-line, QScrollBar::sub-line {{ height: 0; }}
    QScrollBar::add-page, QScrollBar::sub-page {{ background: transparent; }}
    ChoiceBox {{ background: {t.raised}; border: 1px solid {t.line}; border-radius: 5px;
                padding: 3px 8px; color: {t.text}; }}
    ChoiceBox:hover, ChoiceBox:focus {{ border-color: {t.accent}; }}
    ChoiceBox:disabled {{ color: {t.muted}; background: {t.window}; }}
    ChoiceBox::drop-down {{ border: none; width: 20px; }}
    ChoiceBox QAbstractItemView {{ background: {t.raised}; border: 1px solid {t.line};
                selection-background-color: {t.accent}; selection-color: {t.on_accent}; outline: none; }}
    ChoiceBox QAbstractItemView::item {{ padding: 4px 8px; }}
    QCheckBox::indicator:unchecked {{
                background: {t.raised}; border: 1px solid {t.muted}; border-radius: 2px;
                width: 12px; height: 12px; }}
    #small {{ padding: 1px 8px; font-size: 9pt; }}
    #mapBar {{ background: {t.window}; border-bottom: 1px solid {t.line}; }}
    #mapBar QToolButton {{ border: 1px solid {t.line}; padding: 2px 8px; background: {t.raised};
                color: {t.text}; }}
    #mapBar QToolButton:hover, #mapBar QToolButton:focus {{ border-color: {t.accent}; }}
    #mapBar QToolButton:checked {{ background: {t.accent}; color: {t.on_accent}; border-color: {t.accent}; }}
    #mapBar QToolButton:checked:focus {{ border-color: {t.text}; }}
    #sectionBar {{ background: {t.window}; border-bottom: 1px solid {t.line}; }}
    #sectionBar QToolButton {{ border: 1px solid {t.line}; padding: 2px 8px; background: {t.raised};
                color: {t.text}; }}
    #sectionBar QToolButton:hover, #sectionBar QToolButton:focus {{ border-color: {t.accent}; }}
    #drawer {{ background: {t.window}; border-top: 1px solid {t.line}; }}
    #drawer QToolButton {{ border: 1px solid transparent; border-radius: 4px; padding: 1px 6px;
                color: {t.muted}; background: transparent; }}
    #drawer QToolButton:hover, #drawer QToolButton:focus {{ border-color: {t.accent}; }}
    #drawer QToolButton:checked {{ color: {t.text}; background: {t.line}; font-weight: 600; }}
    #chart {{ border: 1px solid {t.line}; border-radius: 5px; }}
    #chart:focus {{ border-color: {t.accent}; }}
    #small {{ padding: 2px 8px; }}
    #fold {{ border: 1px solid transparent; border-radius: 4px; font-weight: 600; padding: 2px; }}
    #fold:focus {{ border-color: {t.accent}; }}
    #section {{ font-size: 11pt; font-weight: 600; }}
    #figure {{ font-weight: 600; }}
    #changed {{ background: {t.raised}; border: 1px solid {t.accent}; border-radius: 6px; }}
    #blocked {{ background: {t.error}; color: {t.on_error}; border-radius: 6px; padding: 8px 10px; }}
    #primary {{ background: {t.accent}; border-color: {t.accent}; color: {t.on_accent}; padding: 6px 12px;
                font-weight: 600; }}
    #primary:hover, #primary:focus {{ border-color: {t.text}; }}
    #primary:pressed {{ background: {t.line}; color: {t.text}; }}
    #primary:disabled {{ background: {t.window}; border-color: {t.line}; color: {t.muted}; }}
    #title {{ font-size: 15pt; font-weight: 600; }}
    #covariate {{ font-weight: 600; }}
    #muted {{ color: {t.muted}; }}
    #panelTitle {{ font-weight: 600; color: {t.text}; }}
    #caption {{ color: {t.text}; }}
    #separator {{ background: {t.line}; }}
    #canvasArea, #heads {{ background: {t.canvas}; }}
    #heads {{ color: {t.text}; }}
    #outline {{ border: 2px solid {t.accent}; }}
    #dropZone {{ border: 2px dashed {t.line}; border-radius: 14px; }}
    #emptyTitle {{ font-size: 18pt; font-weight: 600; }}
    #errorBar {{ background: {t.error}; }}
    #errorBar QTextEdit {{ background: transparent; color: {t.on_error}; border: 1px solid transparent; }}
    #errorBar QTextEdit:focus, #errorBar QPushButton:focus {{ border: 2px solid {t.on_error}; }}
    #errorBar QPushButton {{ background: transparent; color: {t.on_error}; border-color: {t.on_error}; }}
    """
