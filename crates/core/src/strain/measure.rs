//! Strain of a pose at all evaluation points of a body, and the choice of the few that are watched for a contact.

use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use super::loading::loadings;
use super::response::{MAX_CONTACTS_WATCHED, Place, StrainResponse};
use super::watched_points::choose;
use super::{GradientOperator, StrainKind};
use crate::element::{Face, Tri3, Tri6};
use crate::green::{Extension, GreensFunction, TouchNode};
use crate::mesh::{Faces, Surface};
use crate::{Error, Result};

/// Rows of a sparse matrix in compressed form: six rows a place (xx, yy, zz, xy, yz, zx), columns all dofs of the mesh.
#[derive(Clone, Copy)]
pub struct StrainOperator<'a> {
    /// First entry of each row, and the end.
    pub start: &'a [usize],
    /// Column of each entry.
    pub columns: &'a [u32],
    /// Value of each entry, 1/m.
    pub values: &'a [f64],
}

/// A patch: ranks of its surface nodes, and their weights.
pub type PatchNodes<'a> = (&'a [u32], &'a [f64]);

/// How strain is measured on one body.
pub struct StrainMeasure {
    kind: StrainKind,
    gradients: GradientOperator,
    /// By the elements: what extends displacements of the surface to all nodes.
    interior: Option<Arc<dyn Extension>>,
    /// By the surface alone: rest positions, of which the gradient is taken too. Empty otherwise.
    positions: Vec<[f64; 3]>,
    surface_count: usize,
}

impl StrainMeasure {
    /// The infinitesimal strain that a linear operator recovers from the displacements of all nodes.
    ///
    /// # Errors
    /// An operator that is not the symmetric part of a gradient, or names nodes that the body does not have.
    pub fn of_elements(operator: StrainOperator<'_>, interior: Arc<dyn Extension>) -> Result<Self> {
        Ok(Self::of_gradients(gradients_of(operator, interior.dof_count() / 3)?, interior))
    }

    /// The infinitesimal strain of displacement gradients, as [`StrainMeasure::gradients`] has them.
    pub fn of_gradients(gradients: GradientOperator, interior: Arc<dyn Extension>) -> Self {
        let surface_count = interior.surface_count();
        let kind = StrainKind::Infinitesimal;
        Self { kind, gradients, interior: Some(interior), positions: Vec::new(), surface_count }
    }

    /// The gradients of displacements at all places: from nodes of the body, or of the surface alone.
    pub fn gradients(&self) -> &GradientOperator {
        &self.gradients
    }

    /// The Green strain in the plane of the elements' faces: once on a flat face, at each of its nodes on a 6-node one.
    ///
    /// Every face counts by itself. What is drawn for 6-node faces averages those around a node, which is never more than
    /// the largest of them: a limit that is kept here is kept there.
    pub fn of_surface(surface: &Surface) -> Self {
        let gradients = match &surface.faces {
            Faces::Linear(faces) => face_gradients::<Tri3, 3>(surface, faces, &[DVec3::splat(1.0 / 3.0)]),
            Faces::Quadratic(faces) => face_gradients::<Tri6, 6>(surface, faces, &Tri6::NODES),
        };
        let positions: Vec<_> = surface.positions.iter().map(|p| p.to_array()).collect();
        let surface_count = positions.len();
        Self { kind: StrainKind::InPlane, gradients, interior: None, positions, surface_count }
    }

    /// Strain response to forces on up to four patches, about the pose of the body's own loads.
    ///
    /// Places at which those loads alone pass `limit` do not count: no tool could bring them back. It takes milliseconds,
    /// on the threads of rayon.
    ///
    /// # Errors
    /// No patch or too many, nodes that may not be touched, a limit that is not positive, a Green's function of another
    /// body.
    pub fn prepare(&self, green: &GreensFunction, patches: &[PatchNodes<'_>], limit: f64) -> Result<StrainResponse> {
        let places = self.places(green, patches)?;
        if !(limit > 0.0 && limit.is_finite()) {
            return Err(Error::Invalid(format!("the limit of strain must be positive, got {limit}")));
        }
        let loaded = green.free_response.iter().any(|&u| u != 0.0);
        // Then a loading turned round strains differently, and counts as another one.
        let both_signs = loaded || self.kind == StrainKind::InPlane;
        let chosen = choose(self.kind, patches.len(), &places, &loadings(patches.len()), both_signs, limit);
        Ok(StrainResponse::new(self.kind, patches.len(), &chosen))
    }

    /// Largest strain of displacements (3s) of the surface, m, over all places.
    ///
    /// # Errors
    /// A length that is not three a surface node, or a number that is not finite.
    pub fn largest(&self, displacements: &[f64]) -> Result<f64> {
        if let Some(row) = displacements.iter().position(|u| !u.is_finite()) {
            return Err(Error::Invalid(format!("the displacement of surface node {} is not finite", row / 3)));
        }
        let base = self.sample_pose(displacements)?;
        Ok(base.iter().fold(0.0, |largest, sample| self.kind.magnitude_above(sample, largest)))
    }

    /// Base and slopes at all places.
    fn places(&self, green: &GreensFunction, patches: &[PatchNodes<'_>]) -> Result<Vec<Place>> {
        self.check(green, patches)?;
        let rows = 3 * self.surface_count;
        let mut fields = vec![0.0; 3 * patches.len() * rows];
        fields.par_chunks_exact_mut(rows).enumerate().for_each(|(k, field)| {
            patch_response(green, patches[k / 3], k % 3, field);
        });
        let free = green.free_displacements();
        let base = match self.interior.is_some() && free.iter().all(|&u| u == 0.0) && green.loads.is_empty() {
            true => vec![[0.0; 6]; self.gradients.place_count()],
            false => self.sample_pose(&free)?,
        };
        let everywhere = match &self.interior {
            Some(interior) => interior.extend_responses(&fields)?,
            None => fields,
        };
        let blank = [[[0.0; 6]; 3]; MAX_CONTACTS_WATCHED];
        let mut places: Vec<Place> = base.into_iter().map(|base| Place { base, slope: blank }).collect();
        let dofs = everywhere.len() / (3 * patches.len());
        for (contact, fields) in everywhere.chunks_exact(3 * dofs).enumerate() {
            let slopes = self.gradients.sample::<3>(self.kind, &by_node(fields));
            places.iter_mut().zip(slopes).for_each(|(place, slope)| place.slope[contact] = slope);
        }
        Ok(places)
    }

    /// What strain follows from at all places in a pose.
    fn sample_pose(&self, displacements: &[f64]) -> Result<Vec<[f64; 6]>> {
        if displacements.len() != 3 * self.surface_count {
            let (count, given) = (self.surface_count, displacements.len());
            return Err(Error::Invalid(format!(
                "displacements of {count} surface nodes are needed, got {given} numbers"
            )));
        }
        let mut nodes: Vec<[[f64; 3]; 1]> = match &self.interior {
            Some(interior) => by_node(&interior.extend(displacements)?),
            None => by_node(displacements),
        };
        for ([u], x) in nodes.iter_mut().zip(&self.positions) {
            (0..3).for_each(|k| u[k] += x[k]);
        }
        Ok(self.gradients.sample::<1>(self.kind, &nodes).into_iter().map(|[sample]| sample).collect())
    }

    fn check(&self, green: &GreensFunction, patches: &[PatchNodes<'_>]) -> Result<()> {
        if green.surface_count() != self.surface_count {
            let (own, other) = (self.surface_count, green.surface_count());
            return Err(Error::Invalid(format!("strain is measured at {own} surface nodes, the body has {other}")));
        }
        if patches.is_empty() || patches.len() > MAX_CONTACTS_WATCHED {
            let count = patches.len();
            return Err(Error::Invalid(format!(
                "strain is watched for 1 to {MAX_CONTACTS_WATCHED} contacts, got {count}"
            )));
        }
        for &(nodes, weights) in patches {
            if nodes.len() != weights.len() {
                let (nodes, weights) = (nodes.len(), weights.len());
                return Err(Error::Invalid(format!("a patch of {nodes} nodes has {weights} weights")));
            }
            let touchable = |&&n: &&u32| (n as usize) < self.surface_count && green.touchable(n as usize).is_some();
            if let Some(node) = nodes.iter().find(|n| !touchable(n)) {
                return Err(Error::Invalid(format!("surface node {node} under a contact is not touchable")));
            }
        }
        Ok(())
    }
}

/// Adds `Psi W e_axis` to displacements of the surface (3s), m/N.
fn patch_response(green: &GreensFunction, (nodes, weights): PatchNodes<'_>, axis: usize, field: &mut [f64]) {
    let column = |&node: &u32| green.touchable(node as usize);
    let forces: Vec<(TouchNode, DVec3)> = nodes
        .iter()
        .zip(weights)
        .filter_map(|(node, &weight)| column(node).map(|column| (column, weight * DVec3::AXES[axis])))
        .collect();
    green.add_forces(&forces, field);
}

/// `F` fields one after the other, as vectors of all fields at each node.
fn by_node<const F: usize>(fields: &[f64]) -> Vec<[[f64; 3]; F]> {
    let dofs = fields.len() / F;
    (0..dofs / 3)
        .map(|node| std::array::from_fn(|f| std::array::from_fn(|k| fields[f * dofs + 3 * node + k])))
        .collect()
}

/// The gradient of which an operator is the symmetric part: its rows xx, yy and zz hold `g_n`, the others are checked.
fn gradients_of(operator: StrainOperator<'_>, node_count: usize) -> Result<GradientOperator> {
    let wrong = |what: String| Error::Invalid(format!("the strain operator {what}"));
    let StrainOperator { start, columns, values } = operator;
    let rows = start.len().saturating_sub(1);
    let ascending = start.windows(2).all(|s| s[0] <= s[1]) && start.first() == Some(&0);
    if rows == 0 || rows % 6 != 0 || !ascending || start[rows] != columns.len() || columns.len() != values.len() {
        return Err(wrong("needs six rows a place, and as many columns as values".into()));
    }
    if let Some(column) = columns.iter().find(|&&c| c as usize >= 3 * node_count) {
        return Err(wrong(format!("names dof {column}, the body has {}", 3 * node_count)));
    }
    let row =
        |r: usize| columns[start[r]..start[r + 1]].iter().copied().zip(values[start[r]..start[r + 1]].iter().copied());
    let place = |p: usize| -> Result<Vec<(u32, [f64; 3])>> {
        let mut nodes: Vec<u32> = (0..3).flat_map(|k| row(6 * p + k)).map(|(column, _)| column / 3).collect();
        nodes.sort_unstable();
        nodes.dedup();
        let mut entries: Vec<(u32, [f64; 3])> = nodes.into_iter().map(|n| (n, [0.0; 3])).collect();
        for axis in 0..3u32 {
            for (column, value) in row(6 * p + axis as usize) {
                let at = entries.binary_search_by_key(&(column / 3), |e| e.0);
                match at {
                    Ok(at) if column % 3 == axis => entries[at].1[axis as usize] += value,
                    _ => return Err(wrong(format!("is not a gradient in row {}", 6 * p + axis as usize))),
                }
            }
        }
        let scale = entries.iter().flat_map(|e| e.1).fold(0.0, |m: f64, g| m.max(g.abs()));
        for (k, (i, j)) in [(0, 1), (1, 2), (2, 0)].into_iter().enumerate() {
            for (column, value) in row(6 * p + 3 + k) {
                let axis = column as usize % 3;
                let other = if axis == i { j } else { i };
                let entry =
                    entries.binary_search_by_key(&(column / 3), |e| e.0).map_or([f64::NAN; 3], |at| entries[at].1);
                let fits = (axis == i || axis == j) && (value - 0.5 * entry[other]).abs() <= 1e-9 * scale;
                if !fits && value != 0.0 {
                    return Err(wrong(format!("is not the symmetric part of a gradient in row {}", 6 * p + 3 + k)));
                }
            }
        }
        Ok(entries)
    };
    let places = (0..rows / 6).map(place).collect::<Result<Vec<_>>>()?;
    Ok(GradientOperator::new(places.into_iter()))
}

/// Coefficients of `F = D R^-1` at the given points of each face: with the derivatives `(s_n, t_n)` of its shape functions,
/// `D = sum x_n (x) (s_n, t_n)`, and `R` the same at rest in orthonormal axes of its plane.
fn face_gradients<F: Face<N>, const N: usize>(
    surface: &Surface,
    faces: &[[u32; N]],
    points: &[DVec3],
) -> GradientOperator {
    let place = |face: &[u32; N], point: DVec3| {
        let derivatives = F::derivatives(point);
        let mut tangents = [DVec3::ZERO; 2];
        for (&node, [s, t]) in face.iter().zip(derivatives) {
            let x = surface.positions[node as usize];
            tangents[0] += x * s;
            tangents[1] += x * t;
        }
        // R = [[length, along], [0, across]]: its inverse is written out.
        let length = tangents[0].length();
        let axis = tangents[0] / length;
        let along = tangents[1].dot(axis);
        let across = (tangents[1] - along * axis).length();
        let row = |(&node, [s, t]): (&u32, [f64; 2])| (node, [s / length, (t - s * along / length) / across, 0.0]);
        face.iter().zip(derivatives).map(row).collect::<Vec<_>>()
    };
    GradientOperator::new(faces.iter().flat_map(|face| points.iter().map(move |&point| place(face, point))))
}
