//! Twin of `shader/mesh.wgsl`.

use glam::{Vec2, Vec3, Vec4, Vec4Swizzles as _};

use super::sampling::{MapSampler, Place, mix, saturate, smoothstep};
use crate::MeshView;
use crate::material::{MAPS, MaterialUniforms};
use crate::uniforms::Uniforms;

/// What the vertex stage passes to the fragment stage, interpolated.
pub(crate) struct Surface {
    world: Vec3,
    normal: Vec3,
    place: Place,
    color: Vec4,
    highlight: f32,
    /// Two edges of the triangle, and how texture coordinates change along them.
    edges: [(Vec3, Vec2); 2],
    front: bool,
}

/// A point of a triangle, by the weights of its corners: of the pixel's centre, and of the pixels of its quad (four that
/// start at even numbers) from which a graphics chip takes differences across and down.
pub(crate) fn interpolate(mesh: &MeshView, triangle: u32, front: bool, [weights, quad @ ..]: [Vec3; 4]) -> Surface {
    let corners = mesh.triangles[triangle as usize].map(|c| c as usize);
    let blend = |of: &dyn Fn(usize) -> Vec3| {
        of(corners[0]) * weights.x + of(corners[1]) * weights.y + of(corners[2]) * weights.z
    };
    let [a, b, c] = corners.map(|c| Vec3::from(mesh.positions[c]));
    let [uv_a, uv_b, uv_c] = corners.map(|c| mesh.uv.map_or(Vec2::ZERO, |uv| Vec2::from(uv[c])));
    let uv = |weights: Vec3| uv_a * weights.x + uv_b * weights.y + uv_c * weights.z;
    let color = mesh.colors.map_or(Vec4::ONE, |all| {
        let [a, b, c] = corners.map(|c| Vec4::from(all[c]));
        a * weights.x + b * weights.y + c * weights.z
    });
    Surface {
        world: blend(&|c| Vec3::from(mesh.positions[c])),
        normal: blend(&|c| Vec3::from(mesh.normals[c])),
        place: Place { uv: uv(weights), steps: [uv(quad[1]) - uv(quad[0]), uv(quad[2]) - uv(quad[0])] },
        color,
        highlight: mesh.highlight.map_or(0.0, |h| blend(&|c| Vec3::splat(h[c])).x),
        edges: [(b - a, uv_b - uv_a), (c - a, uv_c - uv_a)],
        front,
    }
}

/// The material that a part is drawn with.
pub(crate) struct Paint<'a> {
    pub(crate) material: MaterialUniforms,
    /// Base colour, metallic-roughness, normal, emissive.
    pub(crate) maps: [MapSampler<'a>; MAPS],
}

const LIGHT_SIZE: f32 = 0.2;

impl Paint<'_> {
    /// Whether there is anything to see of the surface: its opacity is enough, and the material shows this side.
    pub(crate) fn shows(&self, surface: &Surface) -> bool {
        let Self { material, maps } = self;
        let opacity = material.base_color.w * surface.color.w * maps[0].sample(surface.place).w;
        (opacity >= material.surface.w || opacity.is_nan()) && (material.flags.z <= 0.5 || surface.front)
    }

    /// Whether [`shows`](Self::shows) can be false.
    pub(crate) fn has_holes(&self) -> bool {
        self.material.surface.w > 0.0 || self.material.flags.z > 0.5
    }
}

/// Linear light from the surface towards the eye, and its opacity.
pub(crate) fn fragment(u: &Uniforms, paint: &Paint, surface: &Surface) -> Vec4 {
    let Paint { material, maps } = paint;
    let base = material.base_color * surface.color * maps[0].sample(surface.place);
    let opacity = if material.flags.w > 0.5 { base.w } else { 1.0 };
    let tinted = mix(base.xyz(), u.highlight.xyz(), saturate(surface.highlight) * 0.75);
    let emitted = material.emissive.xyz() * maps[3].sample(surface.place).xyz();
    if material.flags.x > 0.5 {
        return (tinted + emitted).extend(opacity);
    }

    let smooth_normal = unit(surface.normal);
    let [(right, uv_right), (down, uv_down)] = surface.edges;
    let mut shading = smooth_normal;
    if material.flags.y > 0.5 {
        let determinant = uv_right.x * uv_down.y - uv_down.x * uv_right.y;
        let turn = if determinant == 0.0 { 0.0 } else { determinant.signum() };
        let across = (right * uv_down.y - down * uv_right.y) * turn;
        let up = (right * uv_down.x - down * uv_right.x) * turn;
        let tangent = unit(across - smooth_normal * smooth_normal.dot(across));
        let bitangent = unit(up - smooth_normal * smooth_normal.dot(up));
        let scale = Vec3::new(material.surface.z, material.surface.z, 1.0);
        let tilt = (maps[2].sample(surface.place).xyz() * 2.0 - 1.0) * scale;
        shading = unit(tangent * tilt.x + bitangent * tilt.y + smooth_normal * tilt.z);
    }
    let to_eye = unit(u.eye.xyz() - surface.world);
    let outwards = right.cross(down);
    let seen_side = if surface.front { outwards } else { -outwards };
    let normal = if smooth_normal.dot(seen_side) >= 0.0 { shading } else { -shading };
    let facing = saturate(normal.dot(to_eye));

    let surface_texel = maps[1].sample(surface.place);
    let metallic = saturate(material.surface.x * surface_texel.z);
    let roughness = (material.surface.y * surface_texel.y).clamp(0.05, 1.0);
    let alpha = roughness * roughness;
    let reflectance = mix(Vec3::splat(0.04), tinted, metallic);
    let diffuse = tinted * (1.0 - metallic);
    let above = saturate((surface.world.y - u.ground.x) / (0.5 * u.ground.z));
    let openness = 1.0 + (0.45 + 0.55 * above - 1.0) * saturate(0.5 - 0.5 * normal.y);
    let ambient = mix(u.bounce.xyz(), u.sky.xyz(), 0.5 + 0.5 * normal.y);
    let key = wrapped(normal.dot(u.key_direction.xyz()), 0.05);
    let fill = wrapped(normal.dot(u.fill_direction.xyz()), 0.45);
    let edge = (1.0 - facing).powi(3);
    let rim = edge * saturate(0.35 + 0.65 * normal.dot(u.rim_direction.xyz()));
    let mirrored = normal * (2.0 * normal.dot(to_eye)) - to_eye;
    let shine = |towards: Vec4, light: Vec4| gloss(towards.xyz(), light.xyz(), normal, to_eye, reflectance, alpha);
    let light = diffuse * (ambient * openness + u.key_color.xyz() * key + u.fill_color.xyz() * fill)
        + reflected(reflectance, roughness, facing) * surroundings(u, mirrored, roughness) * openness
        + shine(u.key_direction, u.key_color)
        + shine(u.fill_direction, u.fill_color)
        + shine(u.rim_direction, u.rim_color) * metallic
        + u.rim_color.xyz() * rim;
    (light + emitted).extend(opacity)
}

fn unit(v: Vec3) -> Vec3 {
    v / v.length_squared().max(1e-36).sqrt()
}

fn wrapped(cosine: f32, wrap: f32) -> f32 {
    saturate((cosine + wrap) / (1.0 + wrap))
}

fn gloss(towards: Vec3, light: Vec3, normal: Vec3, to_eye: Vec3, reflectance: Vec3, alpha: f32) -> Vec3 {
    let half_way = unit(to_eye + towards);
    let (lit, facing) = (saturate(normal.dot(towards)), saturate(normal.dot(to_eye)));
    let wide = (alpha + LIGHT_SIZE).min(1.0);
    let peak = saturate(normal.dot(half_way));
    let spread = peak * peak * (wide * wide - 1.0) + 1.0;
    let (grazing, straight) = (2.0 * lit * facing, lit + facing);
    let shadowing = 0.5 / (grazing * (1.0 - wide) + straight * wide).max(1e-4);
    let fresnel = reflectance + (1.0 - reflectance) * (1.0 - saturate(to_eye.dot(half_way))).powi(5);
    light * fresnel * (wide * wide / (spread * spread) * shadowing * lit)
}

fn reflected(reflectance: Vec3, roughness: f32, facing: f32) -> Vec3 {
    let fit = roughness * Vec4::new(-1.0, -0.0275, -0.572, 0.022) + Vec4::new(1.0, 0.0425, 1.04, -0.04);
    let edge = (fit.x * fit.x).min((-9.28 * facing).exp2()) * fit.x + fit.y;
    reflectance * (fit.z - 1.04 * edge) + (fit.w + 1.04 * edge)
}

fn surroundings(u: &Uniforms, towards: Vec3, roughness: f32) -> Vec3 {
    let blur = 0.1 + 0.6 * roughness;
    let room = mix(u.bounce.xyz(), u.sky.xyz(), smoothstep(-blur, blur, towards.y));
    room + u.sky.xyz() * (4.0 * smoothstep(0.25 - blur, 0.75 + blur, towards.y))
}
