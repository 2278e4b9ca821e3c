//! How a character's weights were made, as bytes and back.

use armature_weights::handles::FREE_NEAR_JOINTS;

use super::bytes::{Reader, Writer};
use super::error::CacheError;
use crate::character::{BiharmonicRecord, HeatRecord, Provenance, WeightsRecord};
use crate::handle_weights::{BiharmonicTier, DomainKind};

const ARTIST: u8 = 0;
const HEAT: u8 = 1;
const GENERATED_HEAT: u8 = 2;
/// Before version 4, bones were always released by [`FREE_NEAR_JOINTS`] and flat elements were not counted.
const OLD_BIHARMONIC: u8 = 3;
const OLD_GENERATED_BIHARMONIC: u8 = 4;
const BIHARMONIC: u8 = 5;
const GENERATED_BIHARMONIC: u8 = 6;

/// In the file, a tier or domain is its index here.
const TIERS: [BiharmonicTier; 2] = [BiharmonicTier::Interactive, BiharmonicTier::Certified];
const DOMAINS: [DomainKind; 4] = [DomainKind::Volume, DomainKind::Flat, DomainKind::OwnTetrahedra, DomainKind::Surface];

pub(super) fn write_provenance(w: &mut Writer, provenance: &Provenance) {
    write_tagged(w, provenance, [BIHARMONIC, GENERATED_BIHARMONIC]);
    if let Some(WeightsRecord::Biharmonic(record)) = provenance.record() {
        w.f64(record.joint_release);
        // The count plus one, or 0 if unknown.
        w.count(record.flat_elements.map_or(0, |count| count + 1));
    }
}

/// As before version 4.
pub(super) fn write_old_provenance(w: &mut Writer, provenance: &Provenance) {
    write_tagged(w, provenance, [OLD_BIHARMONIC, OLD_GENERATED_BIHARMONIC]);
}

fn write_tagged(w: &mut Writer, provenance: &Provenance, biharmonic: [u8; 2]) {
    w.byte(match provenance {
        Provenance::Artist => ARTIST,
        Provenance::Computed(WeightsRecord::BoneHeat(_)) => HEAT,
        Provenance::Generated(WeightsRecord::BoneHeat(_)) => GENERATED_HEAT,
        Provenance::Computed(WeightsRecord::Biharmonic(_)) => biharmonic[0],
        Provenance::Generated(WeightsRecord::Biharmonic(_)) => biharmonic[1],
    });
    match provenance.record() {
        None => {}
        Some(&WeightsRecord::BoneHeat(HeatRecord { heat, max_influences, residual, max_dropped })) => {
            w.f64(heat);
            w.count(max_influences);
            w.f64(residual);
            w.f64(max_dropped);
        }
        Some(WeightsRecord::Biharmonic(record)) => write_old_biharmonic(w, record),
    }
}

/// All but what version 4 added.
fn write_old_biharmonic(w: &mut Writer, record: &BiharmonicRecord) {
    // Destructured, so that a new field cannot be forgotten here.
    let &BiharmonicRecord {
        tier,
        domain,
        domain_vertices,
        joint_release: _,
        flat_elements: _,
        error_bound,
        energy,
        unconverged,
        largest_deviation,
        max_influences,
        max_dropped,
        mean_dropped,
    } = record;
    w.byte(TIERS.iter().position(|t| *t == tier).unwrap_or_default() as u8);
    w.byte(DOMAINS.iter().position(|d| *d == domain).unwrap_or_default() as u8);
    [domain_vertices, unconverged, max_influences].into_iter().for_each(|count| w.count(count));
    for number in [error_bound, energy, largest_deviation, max_dropped, mean_dropped] {
        w.f64(number);
    }
}

pub(super) fn read_provenance(r: &mut Reader) -> Result<Provenance, CacheError> {
    match r.byte()? {
        ARTIST => Ok(Provenance::Artist),
        HEAT => Ok(Provenance::Computed(read_heat(r)?)),
        GENERATED_HEAT => Ok(Provenance::Generated(read_heat(r)?)),
        OLD_BIHARMONIC => Ok(Provenance::Computed(WeightsRecord::Biharmonic(read_old_biharmonic(r)?))),
        OLD_GENERATED_BIHARMONIC => Ok(Provenance::Generated(WeightsRecord::Biharmonic(read_old_biharmonic(r)?))),
        BIHARMONIC => Ok(Provenance::Computed(read_biharmonic(r)?)),
        GENERATED_BIHARMONIC => Ok(Provenance::Generated(read_biharmonic(r)?)),
        kind => Err(r.bad(format!("weights of an unknown kind, {kind}"))),
    }
}

fn read_heat(r: &mut Reader) -> Result<WeightsRecord, CacheError> {
    let heat = r.f64()?;
    let max_influences = read_count(r)?;
    let record = HeatRecord { heat, max_influences, residual: r.f64()?, max_dropped: r.f64()? };
    Ok(WeightsRecord::BoneHeat(record))
}

fn read_biharmonic(r: &mut Reader) -> Result<WeightsRecord, CacheError> {
    let old = read_old_biharmonic(r)?;
    let joint_release = r.f64()?;
    let flat_elements = read_count(r)?.checked_sub(1);
    Ok(WeightsRecord::Biharmonic(BiharmonicRecord { joint_release, flat_elements, ..old }))
}

fn read_old_biharmonic(r: &mut Reader) -> Result<BiharmonicRecord, CacheError> {
    let tier = r.byte()?;
    let tier = *TIERS.get(usize::from(tier)).ok_or_else(|| r.bad(format!("an unknown tier of weights, {tier}")))?;
    let domain = r.byte()?;
    let domain =
        *DOMAINS.get(usize::from(domain)).ok_or_else(|| r.bad(format!("weights on something unknown, {domain}")))?;
    let [domain_vertices, unconverged, max_influences] = [read_count(r)?, read_count(r)?, read_count(r)?];
    Ok(BiharmonicRecord {
        tier,
        domain,
        domain_vertices,
        joint_release: FREE_NEAR_JOINTS,
        flat_elements: None,
        error_bound: r.f64()?,
        energy: r.f64()?,
        unconverged,
        largest_deviation: r.f64()?,
        max_influences,
        max_dropped: r.f64()?,
        mean_dropped: r.f64()?,
    })
}

fn read_count(r: &mut Reader) -> Result<usize, CacheError> {
    Ok(usize::try_from(u64::from_le_bytes(r.array()?)).unwrap_or(usize::MAX))
}
