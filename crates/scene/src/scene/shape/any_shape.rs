//! Shapes drawn at random, for tests of all kinds.

use glam::DVec3;
use proptest::prelude::*;

use super::Shape;

/// A point of a cube about the lidar, `within_m` each way.
pub(in crate::scene) fn any_point(within_m: f64) -> impl Strategy<Value = DVec3> {
    let along = -within_m..within_m;
    (along.clone(), along.clone(), along).prop_map(|(x, y, z)| DVec3::new(x, y, z))
}

/// A shape of any kind but those of files, within 20 m.
pub(in crate::scene) fn any_shape() -> impl Strategy<Value = Shape> {
    let middle = || any_point(20.0);
    let any_way = || any_point(1.0).prop_filter("a direction", |axis| axis.length() > 0.1);
    prop_oneof![
        Just(Shape::Ground { depth_m: 1.5 }),
        (middle(), any_way(), 0.1f64..9.0, 0.1f64..9.0).prop_map(
            |(centre_m, normal, width_m, height_m)| Shape::Plane {
                centre_m,
                normal,
                width_m,
                height_m
            }
        ),
        (middle(), any_point(5.0), -180f64..180.0).prop_map(|(centre_m, size, yaw_deg)| {
            Shape::Box {
                centre_m,
                size_m: size.abs() + 0.01,
                yaw_deg,
            }
        }),
        (middle(), 0.1f64..4.0)
            .prop_map(|(centre_m, radius_m)| Shape::Sphere { centre_m, radius_m }),
        (middle(), any_way(), 0.1f64..2.0, 0.1f64..9.0).prop_map(
            |(centre_m, axis, radius_m, height_m)| Shape::Cylinder {
                centre_m,
                axis,
                radius_m,
                height_m
            }
        ),
        (middle(), any_way(), 0.1f64..2.0, 0f64..3.0, 0.1f64..9.0).prop_map(
            |(centre_m, axis, radius_m, tip_radius_m, height_m)| Shape::Cone {
                centre_m,
                axis,
                radius_m,
                tip_radius_m,
                height_m
            }
        ),
        (middle(), 0.5f64..3.0, -180f64..180.0).prop_map(|(foot_m, height_m, yaw_deg)| {
            Shape::Person {
                foot_m,
                height_m,
                yaw_deg,
            }
        }),
    ]
}
