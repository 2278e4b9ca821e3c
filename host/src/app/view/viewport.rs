//! The picture: the character on its stage, and the overlays.

use armature_render::Bounds;
use eframe::egui::{
    self, Align, Layout, PointerButton, Rect, Response, RichText, Role, Sense, Ui, UiBuilder, Vec2, WidgetInfo, vec2,
};
use eframe::egui_wgpu::RenderState;

use super::camera_rig::CameraRig;
use super::stage::Stage;
use super::{menus, notices, transport, widgets};
use crate::app::action::Action;
use crate::app::controls::Drag;
use crate::app::paint;
use crate::app::state::{Connection, State};
use crate::app::theme;
use crate::characters::OWN;
use crate::engine::command::CharacterChoice;

/// Camera and scene.
#[derive(Debug, Default)]
pub(super) struct Viewport {
    rig: CameraRig,
    stage: Stage,
    started: bool,
    trouble: Option<String>,
}

impl Viewport {
    /// Frames the whole character.
    pub(super) fn frame_all(&mut self, state: &State, aspect: f32) {
        let posed = state.frame.as_deref().and_then(|frame| Bounds::of(&frame.positions));
        self.rig.goal.frame(&above_the_bar(posed.unwrap_or(self.stage.bounds)), aspect);
    }

    pub(super) fn show(
        &mut self,
        ui: &mut Ui,
        state: &mut State,
        graphics: Option<&RenderState>,
        actions: &mut Vec<Action>,
    ) {
        let rect = ui.max_rect();
        let response = ui.allocate_rect(rect, Sense::click_and_drag());
        response.widget_info(|| WidgetInfo::labeled(Role::Image, true, "Character"));
        let aspect = rect.width() / rect.height().max(1.0);
        if self.stage.follow(state) || !self.started {
            self.rig.cut_to(&above_the_bar(self.stage.bounds), aspect);
            self.started = true;
        }
        self.steer(ui, &response, aspect, state, actions);
        if std::mem::take(&mut state.wishes.frame_all) {
            self.frame_all(state, aspect);
        }
        if self.rig.glide(ui.input(|input| input.stable_dt)) {
            ui.ctx().request_repaint();
        }
        self.draw(ui, rect, state, graphics);
        title(ui, rect, state, actions);
        cards(ui, rect, |ui| notices::show(ui, state, actions));
        transport::show(ui, rect, state, actions);
        self.invite(ui, rect, state);
    }

    fn steer(&mut self, ui: &Ui, response: &Response, aspect: f32, state: &State, actions: &mut Vec<Action>) {
        let goal = &mut self.rig.goal;
        let drag = response.drag_delta();
        let drag = glam::Vec2::new(drag.x, drag.y);
        let modifiers = ui.input(|input| input.modifiers);
        let buttons = [PointerButton::Primary, PointerButton::Middle, PointerButton::Secondary];
        let dragged = buttons.into_iter().find(|button| response.dragged_by(*button));
        match dragged.and_then(|button| state.controls.drag(button, modifiers)) {
            Some(Drag::Orbit) => goal.orbit(drag),
            Some(Drag::Pan) => goal.pan(drag, response.rect.height()),
            Some(Drag::Zoom) => goal.zoom((drag.y * 0.01).exp(), self.stage.bounds.radius()),
            None => {}
        }
        if response.hovered() {
            let (scroll, pinch) = ui.input(|input| (input.smooth_scroll_delta().y, input.zoom_delta()));
            goal.zoom((-scroll * 0.0016).exp() / pinch.max(0.01), self.stage.bounds.radius());
        }
        if let Some(pointer) = response.interact_pointer_pos().filter(|_| response.clicked()) {
            let camera = self.rig.now;
            let size = glam::Vec2::new(response.rect.width(), response.rect.height());
            let at = pointer - response.rect.min;
            let bone = self.stage.bone_at(state, glam::Vec2::new(at.x, at.y), 14.0, |point| {
                camera.project(point, aspect).map(|seen| seen * size)
            });
            actions.push(Action::Select(bone.and_then(|bone| state.parts_of_bone(bone).next())));
        }
    }

    fn draw(&mut self, ui: &mut Ui, rect: Rect, state: &State, graphics: Option<&RenderState>) {
        let Some(graphics) = graphics else {
            self.trouble = Some("There is no graphics adapter to draw the character with.".into());
            return;
        };
        let scene = self.stage.scene(state);
        match paint::prepare(graphics, &scene, &self.rig.now, paint::pixels(rect, ui.ctx().pixels_per_point())) {
            Ok(()) => {
                self.trouble = None;
                ui.painter().add(paint::callback(rect));
            }
            Err(error) => self.trouble = Some(error.to_string()),
        }
    }

    /// What to do next, as long as there is nothing to see.
    fn invite(&self, ui: &mut Ui, rect: Rect, state: &State) {
        if let Some(trouble) = &self.trouble {
            let text = format!("The character cannot be drawn.\n{trouble}");
            let font = egui::FontId::proportional(14.0);
            ui.painter().text(rect.center(), egui::Align2::CENTER_CENTER, text, font, theme::QUIET);
        }
        let (title, text) = match (&state.character, &state.connection) {
            (None, _) if state.busy.is_some() => return,
            (None, _) => ("No character yet", "Choose one above, or drop a mesh file here."),
            (Some(_), Connection::Off) => {
                ("No puppet connected", "Start a simulated one on the left, or plug a puppet in and choose its port.")
            }
            (Some(_), Connection::On { .. }) if !state.is_live() => {
                ("Connected", "Waiting for the first sample of the puppet.")
            }
            _ => return,
        };
        let width = 360.0_f32.min(rect.width() - 32.0);
        let place = Rect::from_center_size(egui::pos2(rect.center().x, rect.bottom() - 122.0), vec2(width, 64.0));
        ui.scope_builder(UiBuilder::new().max_rect(place).layout(Layout::top_down(Align::Center)), |ui| {
            theme::floating().show(ui, |ui| {
                ui.set_width(width - 24.0);
                ui.spacing_mut().item_spacing.y = 3.0;
                ui.label(RichText::new(title).strong());
                widgets::quiet(ui, text);
            });
        });
    }
}

/// Space below the feet for overlays.
fn above_the_bar(bounds: Bounds) -> Bounds {
    Bounds { min: bounds.min - glam::Vec3::Y * (bounds.size().y * 0.16), ..bounds }
}

/// The upper left: the character's name, and others to choose from.
fn title(ui: &mut Ui, rect: Rect, state: &State, actions: &mut Vec<Action>) {
    let place = Rect::from_min_size(rect.min + vec2(16.0, 14.0), vec2((rect.width() - 32.0).max(0.0), 80.0));
    ui.scope_builder(UiBuilder::new().max_rect(place), |ui| {
        ui.spacing_mut().item_spacing.y = 6.0;
        ui.horizontal(|ui| {
            theme::floating().inner_margin(egui::Margin::same(4)).show(ui, |ui| {
                ui.spacing_mut().item_spacing.x = 2.0;
                let own = OWN.map(|name| Action::Load(CharacterChoice::BuiltIn(name)));
                for action in own.into_iter().chain([Action::OpenCharacter]) {
                    menus::button(ui, &action, Vec2::new(64.0, 26.0), state, actions);
                }
            });
        });
        if let Some(character) = &state.character {
            let triangles = character.shape.as_ref().map_or(0, |shape| shape.triangles().len());
            let triangles = widgets::grouped(triangles as u64);
            let name = widgets::capitalised(&character.name);
            let line = format!("{name}: {triangles} triangles, {} bones", character.skeleton.len());
            ui.label(RichText::new(line).size(12.0).color(theme::QUIET));
        }
    });
}

fn cards(ui: &mut Ui, rect: Rect, content: impl FnOnce(&mut Ui)) {
    let width = 340.0_f32.min(rect.width() - 32.0).max(0.0);
    let corner = egui::pos2(rect.right() - 16.0 - width, rect.top() + 14.0);
    let place = Rect::from_min_size(corner, vec2(width, (rect.height() - 100.0).max(0.0)));
    ui.scope_builder(UiBuilder::new().max_rect(place).layout(Layout::top_down(Align::Min)), content);
}
