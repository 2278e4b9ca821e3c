//! Colours, type and spacing.

use armature_rig::SensorState;
use eframe::egui::{
    self, Color32, CornerRadius, FontFamily, FontId, Margin, Stroke, TextStyle, Vec2, style::WidgetVisuals,
};

/// Behind panels.
pub(super) const PANEL: Color32 = Color32::from_rgb(21, 23, 28);
/// Cards on a panel.
pub(super) const CARD: Color32 = Color32::from_rgb(29, 32, 39);
/// Fields and wells inside cards.
pub(super) const WELL: Color32 = Color32::from_rgb(17, 19, 23);
/// Hairlines.
pub(super) const LINE: Color32 = Color32::from_rgb(43, 47, 56);
/// Text.
pub(super) const TEXT: Color32 = Color32::from_rgb(222, 226, 233);
/// Secondary text.
pub(super) const QUIET: Color32 = Color32::from_rgb(141, 149, 163);
/// Selections and primary buttons.
pub(super) const ACCENT: Color32 = Color32::from_rgb(82, 160, 255);
/// Recording, and failures.
pub(super) const RED: Color32 = Color32::from_rgb(255, 92, 84);
/// Live, and successes.
pub(super) const GREEN: Color32 = Color32::from_rgb(62, 207, 142);
/// A doubtful reading.
pub(super) const AMBER: Color32 = Color32::from_rgb(245, 184, 74);
/// A reading that the device itself distrusts.
pub(super) const VIOLET: Color32 = Color32::from_rgb(190, 130, 255);
/// Absent.
pub(super) const GREY: Color32 = Color32::from_rgb(92, 99, 112);

/// Corners of cards.
pub(super) const CARD_RADIUS: u8 = 10;

/// The colour of a sensor's state.
pub(super) fn state_color(state: SensorState) -> Color32 {
    match state {
        SensorState::Ok => GREEN,
        SensorState::NoData => GREY,
        SensorState::MagnetWeak => AMBER,
        SensorState::Outlier => VIOLET,
    }
}

/// Applies the theme to the whole window.
pub(super) fn apply(ctx: &egui::Context) {
    ctx.set_theme(egui::Theme::Dark);
    ctx.all_styles_mut(|style| {
        style.text_styles = [
            (TextStyle::Heading, FontId::new(19.0, FontFamily::Proportional)),
            (TextStyle::Body, FontId::new(13.5, FontFamily::Proportional)),
            (TextStyle::Button, FontId::new(13.5, FontFamily::Proportional)),
            (TextStyle::Small, FontId::new(11.5, FontFamily::Proportional)),
            (TextStyle::Monospace, FontId::new(12.5, FontFamily::Monospace)),
        ]
        .into();
        style.spacing.item_spacing = Vec2::new(8.0, 8.0);
        style.spacing.button_padding = Vec2::new(12.0, 6.0);
        style.spacing.interact_size.y = 28.0;
        style.spacing.scroll = egui::style::ScrollStyle::thin();
        style.interaction.selectable_labels = false;
        style.interaction.tooltip_delay = 0.35;
        dress(&mut style.visuals);
    });
}

fn dress(visuals: &mut egui::Visuals) {
    visuals.dark_mode = true;
    visuals.override_text_color = Some(TEXT);
    visuals.weak_text_color = Some(QUIET);
    visuals.panel_fill = PANEL;
    visuals.window_fill = CARD;
    visuals.window_stroke = Stroke::new(1.0, LINE);
    visuals.window_corner_radius = CornerRadius::same(CARD_RADIUS);
    visuals.menu_corner_radius = CornerRadius::same(8);
    visuals.extreme_bg_color = WELL;
    visuals.text_edit_bg_color = Some(WELL);
    visuals.faint_bg_color = CARD;
    visuals.selection.bg_fill = ACCENT.gamma_multiply(0.35);
    visuals.selection.stroke = Stroke::new(1.0, ACCENT);
    visuals.hyperlink_color = ACCENT;
    let widget = |fill: Color32, line: Color32| WidgetVisuals {
        bg_fill: fill,
        weak_bg_fill: fill,
        bg_stroke: Stroke::new(1.0, line),
        corner_radius: CornerRadius::same(7),
        fg_stroke: Stroke::new(1.0, TEXT),
        expansion: 0.0,
    };
    visuals.widgets.noninteractive = widget(CARD, LINE);
    visuals.widgets.inactive = widget(Color32::from_rgb(40, 44, 53), Color32::from_rgb(52, 57, 67));
    visuals.widgets.hovered = widget(Color32::from_rgb(50, 55, 66), Color32::from_rgb(72, 79, 92));
    visuals.widgets.active = widget(Color32::from_rgb(60, 66, 79), ACCENT);
    visuals.widgets.open = widget(Color32::from_rgb(46, 50, 60), LINE);
}

/// A card on a panel.
pub(super) fn card() -> egui::Frame {
    egui::Frame::new()
        .fill(CARD)
        .stroke(Stroke::new(1.0, LINE))
        .corner_radius(CornerRadius::same(CARD_RADIUS))
        .inner_margin(Margin::same(14))
}

/// A card floating over the picture.
pub(super) fn floating() -> egui::Frame {
    egui::Frame::new()
        .fill(Color32::from_rgba_unmultiplied(24, 27, 33, 225))
        .stroke(Stroke::new(1.0, Color32::from_rgba_unmultiplied(255, 255, 255, 18)))
        .corner_radius(CornerRadius::same(CARD_RADIUS))
        .inner_margin(Margin::symmetric(12, 8))
}
