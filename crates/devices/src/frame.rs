//! Coordinate axes of all drivers, and those of the vendors.
//!
//! Seen by the person in front of the device: `x` to the right, `y` away, `z` up; metres, newtons, radians. Every vendor's frame
//! is a rotation of it by right angles, the same for positions, velocities, forces and torques.

use glam::{DMat3, DQuat, DVec3};

/// A vendor's frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Frame {
    /// `x` right, `y` away, `z` up: Palpate, Haply.
    RightAwayUp,
    /// `x` right, `y` up, `z` towards the person: OpenHaptics.
    RightUpTowards,
    /// `x` towards the person, `y` right, `z` up: Force Dimension, CHAI3D.
    TowardsRightUp,
}

impl Frame {
    /// Palpate's frame from this one; its columns are the vendor's axes.
    pub fn rotation(self) -> DMat3 {
        match self {
            Frame::RightAwayUp => DMat3::IDENTITY,
            Frame::RightUpTowards => DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y),
            Frame::TowardsRightUp => DMat3::from_cols(DVec3::NEG_Y, DVec3::X, DVec3::Z),
        }
    }

    /// A vector of the vendor in Palpate's frame, to the bit.
    pub fn to_palpate(self, v: DVec3) -> DVec3 {
        match self {
            Frame::RightAwayUp => v,
            Frame::RightUpTowards => DVec3::new(v.x, -v.z, v.y),
            Frame::TowardsRightUp => DVec3::new(v.y, -v.x, v.z),
        }
    }

    /// A vector of Palpate in the vendor's frame, to the bit.
    pub fn to_vendor(self, v: DVec3) -> DVec3 {
        match self {
            Frame::RightAwayUp => v,
            Frame::RightUpTowards => DVec3::new(v.x, v.z, -v.y),
            Frame::TowardsRightUp => DVec3::new(-v.y, v.x, v.z),
        }
    }

    /// An orientation: of a stylus whose own axes the vendor names like those of its frame.
    pub fn orientation_to_palpate(self, q: DQuat) -> DQuat {
        let frame = DQuat::from_mat3(&self.rotation());
        (frame * q * frame.inverse()).normalize()
    }
}

/// Largest deviation of a matrix from a rotation: vendors compute in double precision.
#[cfg(feature = "drivers")]
const ROTATION_TOLERANCE: f64 = 1e-3;

/// Rotation of a vendor's matrix; not a number if it is none.
#[cfg(feature = "drivers")]
pub(crate) fn rotation(matrix: DMat3) -> DQuat {
    let square = (matrix * matrix.transpose() - DMat3::IDENTITY).to_cols_array();
    let is_rotation = matrix.determinant() > 0.0 && square.iter().all(|entry| entry.abs() < ROTATION_TOLERANCE);
    if is_rotation { DQuat::from_mat3(&matrix).normalize() } else { DQuat::from_xyzw(f64::NAN, 0.0, 0.0, 0.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Frame; 3] = [Frame::RightAwayUp, Frame::RightUpTowards, Frame::TowardsRightUp];

    #[test]
    fn frames_are_proper_rotations_and_invert() {
        let v = DVec3::new(0.3, -1.7, 2.9);
        for frame in ALL {
            assert_eq!(frame.rotation().determinant(), 1.0);
            assert_eq!(frame.to_palpate(v), frame.rotation() * v);
            assert_eq!(frame.to_vendor(frame.to_palpate(v)), v);
            let q = DQuat::from_scaled_axis(v);
            let turned = frame.orientation_to_palpate(q);
            assert!((turned * frame.to_palpate(DVec3::X) - frame.to_palpate(q * DVec3::X)).length() < 1e-14);
        }
    }

    /// CHAI3D's driver of the Touch takes (z, x, y) of OpenHaptics, and its frame is that of Force Dimension; the ROS driver
    /// takes (x, -z, y), and its frame is that of Haply.
    #[test]
    fn as_other_drivers_convert() {
        let hd = DVec3::new(1.0, 2.0, 3.0);
        let ours = Frame::RightUpTowards.to_palpate(hd);
        assert_eq!(ours, DVec3::new(hd.x, -hd.z, hd.y));
        assert_eq!(Frame::TowardsRightUp.to_vendor(ours), DVec3::new(hd.z, hd.x, hd.y));
    }
}
