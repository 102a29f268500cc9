//! Finds the serial ports of this computer, and the plotters that answer there.
//!
//! A port is asked for the status, which changes nothing on a plotter, whatever it does. Ports that
//! are not on USB are listed and not asked, because anything may hang there; they can be named.

use crate::error::Error;
use crate::link::{Link as _, SerialLink};
use penup_job::protocol::{Reply, ReplyReader, STATUS_QUERY, Status, is_penup};
use serde::Serialize;
use serialport::{SerialPortInfo, SerialPortType};
use std::io;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

/// The environment variable with the ports to look at, separated by commas, for ports that the
/// system does not list.
pub const PORTS_VARIABLE: &str = "PENUP_PORTS";

/// The word that stands for the port of the only plotter.
pub const AUTOMATIC: &str = "auto";

/// How long a port is asked for the status. Some boards start anew when their port is opened.
const TIMEOUT: Duration = Duration::from_millis(1500);

/// The time between two questions.
const PAUSE: Duration = Duration::from_millis(250);

/// A serial port and what was found there.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Port {
    /// The name of the port, such as `/dev/ttyACM0`.
    pub device: String,
    /// The product at the port, if the system knows it.
    pub product: Option<String>,
    /// What answers at the port.
    #[serde(flatten)]
    pub found: Found,
}

/// What answers at a port.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "found", rename_all = "lowercase")]
pub enum Found {
    /// A plotter with penup firmware.
    Plotter {
        /// The state that it reports.
        state: String,
    },
    /// Something else that sends text.
    Other {
        /// The bytes that it sent, or a part of them.
        said: String,
    },
    /// Nothing answers.
    Silence,
    /// Another program uses the port.
    Held,
    /// The port cannot be opened.
    Closed {
        /// The reason that the operating system gives.
        reason: String,
    },
    /// The port is not on USB, and was not asked.
    Unasked,
}

/// Lists the ports of this computer and asks those on USB what they are.
///
/// # Errors
/// The system cannot list its ports.
pub fn list() -> Result<Vec<Port>, Error> {
    Ok(ask_all(&candidates()?).into_iter().map(|(port, _)| port).collect())
}

/// Opens the port that the user named, or finds the only plotter.
///
/// # Errors
/// The port cannot be opened, another program uses it, or there is no plotter, or more than one.
pub fn open(device: &str) -> Result<SerialLink, Error> {
    if device != AUTOMATIC {
        let device = device.to_owned();
        return SerialLink::open(&device).map_err(|source| match is_held(&device, &source) {
            true => Error::PortsHeld { devices: vec![device] },
            false => Error::Port { device, source },
        });
    }
    find().map(SerialLink::found_again_by_search)
}

/// Finds the only plotter.
///
/// # Errors
/// There is no plotter, or more than one, or another program may be using it.
pub fn find() -> Result<SerialLink, Error> {
    let mut asked = ask_all(&candidates()?);
    let is_plotter = |port: &Port| matches!(port.found, Found::Plotter { .. });
    let plotters = asked.iter().filter(|(port, _)| is_plotter(port)).count();
    let (found, others): (Vec<_>, Vec<_>) = asked.drain(..).partition(|(port, _)| is_plotter(port));
    if plotters > 1 {
        let devices = found.into_iter().map(|(port, _)| port.device).collect();
        return Err(Error::SeveralPlotters { devices });
    }
    let held = others.iter().filter(|(port, _)| port.found == Found::Held);
    let held: Vec<String> = held.map(|(port, _)| port.device.clone()).collect();
    if plotters == 0 && !held.is_empty() {
        return Err(Error::PortsHeld { devices: held });
    }
    found.into_iter().find_map(|(_, link)| link).ok_or_else(|| Error::NoPlotter {
        looked: others.into_iter().map(|(port, _)| port.to_string()).collect(),
    })
}

impl std::fmt::Display for Port {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{}: ", self.device)?;
        match &self.found {
            Found::Plotter { state } => write!(formatter, "penup, {state}")?,
            Found::Other { said } if said.is_empty() => write!(formatter, "no plotter")?,
            Found::Other { said } => write!(formatter, "no penup plotter, it said \"{said}\"")?,
            Found::Silence => write!(formatter, "nothing answers")?,
            Found::Held => write!(formatter, "another program uses it")?,
            Found::Closed { reason } => write!(formatter, "cannot be opened: {reason}")?,
            Found::Unasked => write!(formatter, "not asked, because it is not on USB")?,
        }
        match &self.product {
            Some(product) => write!(formatter, " ({product})"),
            None => Ok(()),
        }
    }
}

/// A port that may be asked.
struct Candidate {
    device: String,
    product: Option<String>,
    is_asked: bool,
}

fn candidates() -> Result<Vec<Candidate>, Error> {
    if let Some(named) = std::env::var_os(PORTS_VARIABLE) {
        let named = named.to_string_lossy().into_owned();
        let devices = named.split(',').map(str::trim).filter(|device| !device.is_empty());
        return Ok(devices
            .map(|device| Candidate { device: device.to_owned(), product: None, is_asked: true })
            .collect());
    }
    // Without this folder `serialport` panics; containers may lack it.
    if cfg!(target_os = "linux") && !Path::new("/sys/class/tty").is_dir() {
        return Ok(Vec::new());
    }
    let ports = serialport::available_ports().map_err(|source| Error::Ports { source })?;
    let mut candidates: Vec<Candidate> = ports
        .into_iter()
        // macOS lists each port twice; this one waits for a carrier.
        .filter(|port| !port.port_name.starts_with("/dev/tty."))
        .map(|port| {
            let (product, is_asked) = match port.port_type {
                SerialPortType::UsbPort(usb) => (usb.product, true),
                _ => (None, false),
            };
            Candidate { device: port.port_name, product, is_asked }
        })
        .collect();
    candidates.sort_by(|a, b| a.device.cmp(&b.device));
    Ok(candidates)
}

/// Asks all candidates at the same time. Returns the link to those that are plotters.
fn ask_all(candidates: &[Candidate]) -> Vec<(Port, Option<SerialLink>)> {
    thread::scope(|scope| {
        let asked: Vec<_> =
            candidates.iter().map(|candidate| scope.spawn(|| ask(candidate))).collect();
        asked.into_iter().filter_map(|thread| thread.join().ok()).collect()
    })
}

fn ask(candidate: &Candidate) -> (Port, Option<SerialLink>) {
    let Candidate { device, product, is_asked } = candidate;
    let port = |found| Port { device: device.clone(), product: product.clone(), found };
    if !is_asked {
        return (port(Found::Unasked), None);
    }
    let mut link = match SerialLink::open(device) {
        Ok(link) => link,
        Err(error) if is_held(device, &error) => return (port(Found::Held), None),
        Err(error) => return (port(Found::Closed { reason: error.to_string() }), None),
    };
    match found_at(&mut link) {
        Ok(found @ Found::Plotter { .. }) => (port(found), Some(link)),
        Ok(found) => (port(found), None),
        Err(error) => (port(Found::Closed { reason: error.to_string() }), None),
    }
}

/// Whether a port cannot be opened because another program uses it. On Windows the library reports
/// a port that does not exist by the same kind of error.
fn is_held(device: &str, error: &serialport::Error) -> bool {
    let is_listed = |ports: Vec<SerialPortInfo>| ports.iter().any(|port| port.port_name == device);
    error.kind() == serialport::ErrorKind::NoDevice
        && (cfg!(unix) || serialport::available_ports().is_ok_and(is_listed))
}

fn found_at(link: &mut SerialLink) -> io::Result<Found> {
    let start = Instant::now();
    let (mut reader, mut buffer) = (ReplyReader::default(), [0; 256]);
    let mut said: Option<String> = None;
    while start.elapsed() < TIMEOUT {
        link.send(&[STATUS_QUERY])?;
        let asked = Instant::now();
        while asked.elapsed() < PAUSE {
            let count = link.receive(&mut buffer, PAUSE / 5)?;
            let bytes = buffer.get(..count).unwrap_or_default();
            if count > 0 {
                said.get_or_insert_default();
            }
            for reply in bytes.iter().filter_map(|&byte| reader.push(byte)) {
                match reply {
                    Reply::Status(status) if is_of_penup(&status) => {
                        return Ok(Found::Plotter { state: status.state });
                    }
                    Reply::Greeting(text) if !is_penup(&text) => {
                        return Ok(Found::Other { said: text });
                    }
                    Reply::Status(_) => said = Some("a status, as Grbl's".to_owned()),
                    Reply::Other(text) => said = Some(text.chars().take(60).collect()),
                    _ => {}
                }
            }
        }
    }
    Ok(said.map_or(Found::Silence, |said| Found::Other { said }))
}

/// Whether a status report has the fields that penup adds to Grbl's.
fn is_of_penup(status: &Status) -> bool {
    status.strokes.is_some() || status.is_computing
}
