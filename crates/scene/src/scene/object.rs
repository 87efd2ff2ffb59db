//! The things in a scene: a shape and what it is made of.

use glam::DVec3;

use super::rig::Waypoint;
use super::shape::{PlacedShape, Shape, Surface};
use super::texture::Texture;

/// A thing that reflects light, evenly and diffusely.
///
/// Make one with [`Object::new`], then change what is to differ.
#[derive(Debug, Clone, PartialEq)]
pub struct Object {
    /// Name for reports and complaints.
    pub name: String,
    /// Lambertian reflectivity at the laser's wavelength, 0 to 1.
    pub reflectivity: f64,
    /// Lambertian reflectivity where the cameras see, 0 to 1; `None` for the same as the laser's.
    pub grey: Option<f64>,
    /// By how much more of the laser's light returns than a Lambertian surface of this reflectivity sends back, 1 or
    /// more: retroreflectors. Sunlight does not return so.
    pub retro: f64,
    /// A second material and where it shows.
    pub texture: Option<Texture>,
    /// Share of light that passes straight through, 0 to 1: panes.
    pub transmittance: f64,
    /// Share of light that is thrown back as by a mirror, 0 to 1.
    pub mirror: f64,
    /// Velocity in the world, m/s.
    pub velocity_m_s: DVec3,
    /// Where it is at what time, as displacements from its place; in order of time. With waypoints there is no velocity.
    pub waypoints: Vec<Waypoint>,
    /// Where and what it is at time 0.
    pub shape: Shape,
}

impl Object {
    /// A thing at rest that looks alike to laser and cameras.
    pub fn new(name: impl Into<String>, reflectivity: f64, shape: Shape) -> Self {
        Object {
            name: name.into(),
            reflectivity,
            grey: None,
            retro: 1.0,
            texture: None,
            transmittance: 0.0,
            mirror: 0.0,
            velocity_m_s: DVec3::ZERO,
            waypoints: Vec::new(),
            shape,
        }
    }

    /// Whether light passes through.
    pub(crate) fn is_pane(&self) -> bool {
        self.transmittance > 0.0
    }

    /// Whether a ray ends where it meets the object: light neither passes through nor is thrown elsewhere.
    pub(super) fn ends_rays(&self) -> bool {
        (self.transmittance, self.mirror) == (0.0, 0.0)
    }

    /// Reflectivity for the laser and for the cameras at a point of the surface of `placed`, the object's shape.
    pub(super) fn material_at(&self, placed: &PlacedShape, point: DVec3, part: u32) -> (f64, f64) {
        let (own_reflectivity, own_grey) = placed.own_material(point);
        let reflectivity = own_reflectivity.unwrap_or(self.reflectivity);
        let grey = own_grey.or(self.grey).unwrap_or(reflectivity);
        let Some(texture) = &self.texture else {
            return (reflectivity, grey);
        };
        let share = texture.share_at(placed.on_surface(point, part, texture.seen_turned_deg));
        let second_grey = texture.second_grey.unwrap_or(texture.second_reflectivity);
        let mix = |first: f64, second: f64| second + (first - second) * share;
        (
            mix(reflectivity, texture.second_reflectivity),
            mix(grey, second_grey),
        )
    }
}
