//! Displacement gradients at many points, from displacements of nodes.

use rayon::prelude::*;

use super::StrainKind;
use crate::{Error, Result};

/// `H_p = sum_n u_n (x) g_pn` at each place `p` of a body: the gradient of the function that elements, or a fit through
/// several of them, make of the displacements `u_n` of the nodes.
///
/// All components of a gradient come from the same functions, so that a place costs three numbers a node; the rows of a
/// matrix for the six components of strain hold nine.
pub struct GradientOperator {
    /// First entry of each place, and the end.
    start: Vec<usize>,
    nodes: Vec<u32>,
    /// `g_pn`, 1/m.
    coefficients: Vec<[f64; 3]>,
}

impl GradientOperator {
    /// From each place's nodes with their coefficients.
    pub(super) fn new(places: impl Iterator<Item = Vec<(u32, [f64; 3])>>) -> Self {
        let mut operator = Self { start: vec![0], nodes: Vec::new(), coefficients: Vec::new() };
        for place in places {
            operator.nodes.extend(place.iter().map(|&(node, _)| node));
            operator.coefficients.extend(place.iter().map(|&(_, g)| g));
            operator.start.push(operator.nodes.len());
        }
        operator
    }

    /// From [`GradientOperator::parts`] for a body of `node_count` nodes.
    ///
    /// # Errors
    /// Parts that do not fit together, or name nodes that the body does not have.
    pub fn from_parts(
        start: Vec<usize>,
        nodes: Vec<u32>,
        coefficients: Vec<[f64; 3]>,
        node_count: usize,
    ) -> Result<Self> {
        let ascending = start.first() == Some(&0) && start.windows(2).all(|s| s[0] <= s[1]);
        let fits = ascending && start.last() == Some(&nodes.len()) && nodes.len() == coefficients.len();
        if !fits || nodes.iter().any(|&node| node as usize >= node_count) {
            return Err(Error::Invalid("the gradients of the body's strain do not fit together".into()));
        }
        Ok(Self { start, nodes, coefficients })
    }

    /// First entry of each place and the end; node and coefficients (1/m) of each entry.
    pub fn parts(&self) -> (&[usize], &[u32], &[[f64; 3]]) {
        (&self.start, &self.nodes, &self.coefficients)
    }

    /// Number of places.
    pub fn place_count(&self) -> usize {
        self.start.len() - 1
    }

    /// What strain follows from at every place, for each of `F` fields given node by node.
    pub(super) fn sample<const F: usize>(&self, kind: StrainKind, fields: &[[[f64; 3]; F]]) -> Vec<[[f64; 6]; F]> {
        (0..self.place_count())
            .into_par_iter()
            .with_min_len(64)
            .map(|place| {
                let mut h = [[[0.0; 3]; 3]; F];
                let entries = self.start[place]..self.start[place + 1];
                for (&node, g) in self.nodes[entries.clone()].iter().zip(&self.coefficients[entries]) {
                    for (h, u) in h.iter_mut().zip(&fields[node as usize]) {
                        for j in 0..3 {
                            for i in 0..3 {
                                h[j][i] += g[j] * u[i];
                            }
                        }
                    }
                }
                h.map(|columns| reduce(kind, &columns))
            })
            .collect()
    }
}

/// Six numbers from the columns `du/dx_j` of a gradient.
fn reduce(kind: StrainKind, h: &[[f64; 3]; 3]) -> [f64; 6] {
    match kind {
        StrainKind::Infinitesimal => {
            [h[0][0], h[1][1], h[2][2], 0.5 * (h[1][0] + h[0][1]), 0.5 * (h[2][1] + h[1][2]), 0.5 * (h[0][2] + h[2][0])]
        }
        StrainKind::InPlane => [h[0][0], h[0][1], h[0][2], h[1][0], h[1][1], h[1][2]],
    }
}
