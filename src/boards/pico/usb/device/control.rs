//! Control transfers at endpoint 0 (USB 2.0, sections 8.5.3 and 9.3).
//!
//! A transfer has a setup stage, with the request; a data stage, unless the request speaks of no
//! data; and a status stage, an empty packet in the other direction, which confirms the transfer. A
//! transfer that the device refuses ends with a stall instead.

use super::super::driver::{Bus, Controller, FROM_0, MOST_DATA, PACKET, PacketError, TO_0};

/// A request of the host's, with the names of USB 2.0 (section 9.3).
#[derive(Debug, Clone, Copy)]
pub struct Request {
    /// `bmRequestType`: the direction of the data, the type of the request and its recipient.
    pub request_type: u8,
    /// `bRequest`: what is requested.
    pub request: u8,
    /// `wValue`.
    pub value: u16,
    /// `wIndex`: an interface or an endpoint, as a rule.
    pub index: u16,
    /// `wLength`: the number of bytes of the data, or the greatest one if the host asks for them.
    pub length: u16,
}

impl Request {
    /// The bit of `bmRequestType` with which the device sends the data.
    const FROM_DEVICE: u8 = 0x80;

    /// Reads the data of a SETUP packet.
    fn parse(setup: [u8; 8]) -> Self {
        let [request_type, request, value @ .., i, j, k, l] = setup;
        Self {
            request_type,
            request,
            value: u16::from_le_bytes(value),
            index: u16::from_le_bytes([i, j]),
            length: u16::from_le_bytes([k, l]),
        }
    }

    /// Whether the host asks for data, and does not send any.
    pub fn is_from_device(&self) -> bool {
        self.request_type & Self::FROM_DEVICE != 0
    }
}

/// What is under way at endpoint 0.
#[derive(Debug, Clone, Copy)]
enum Stage {
    /// Nothing: no request was made yet, or the last one is confirmed or refused.
    Idle,
    /// The data stage, in which the host takes packets. Further data follow.
    DataIn,
    /// The same; an empty packet follows, because the last data fill theirs.
    DataInEmpty,
    /// The status stage: the host sends an empty packet, when it has taken the last data.
    StatusOut,
    /// The data stage, in which the host sends packets of this request.
    DataOut(Request),
    /// The status stage: the host takes an empty packet.
    StatusIn,
}

/// The state of endpoint 0.
pub struct ControlPipe {
    stage: Stage,
    /// The data of the transfer.
    data: [u8; MOST_DATA],
    /// The number of bytes of `data` that belong to the transfer.
    length: usize,
    /// The number of those that were exchanged.
    moved: usize,
}

impl ControlPipe {
    /// Makes the state before the first request.
    pub const fn new() -> Self {
        Self { stage: Stage::Idle, data: [0; MOST_DATA], length: 0, moved: 0 }
    }

    /// Breaks off the transfer, because the bus was reset.
    pub fn reset(&mut self) {
        self.stage = Stage::Idle;
    }

    /// The data that the host has sent with the request.
    pub fn data(&self) -> &[u8] {
        self.data.get(..self.length).unwrap_or_default()
    }

    /// Reads the host's request, with which the transfer before ends. Returns it if it is to be
    /// carried out now; otherwise its data must come first.
    ///
    /// A request with more data than there is room for leaves the transfer before as it is. The
    /// driver refuses its data.
    pub fn set_up<C: Controller>(&mut self, bus: &Bus<C>) -> Option<Request> {
        let request = Request::parse(bus.read_setup()?);
        let length = usize::from(request.length);
        if request.is_from_device() {
            self.stage = Stage::Idle;
        } else if length == 0 {
            self.stage = Stage::Idle;
            self.length = 0;
        } else if length <= MOST_DATA {
            self.stage = Stage::DataOut(request);
            self.length = length;
            self.moved = 0;
            return None;
        } else {
            return None;
        }
        Some(request)
    }

    /// Reads a packet that is not a request. Returns the request if its data have come with it.
    pub fn take_packet<C: Controller>(&mut self, bus: &Bus<C>) -> Option<Request> {
        match self.stage {
            Stage::DataOut(request) => {
                let room = self.data.get_mut(self.moved..).unwrap_or_default();
                match bus.read(TO_0, room) {
                    Ok(count) => self.moved += count,
                    Err(PacketError::WouldBlock) => {}
                    Err(PacketError::Overflow) => self.reject(bus),
                }
                let is_whole = self.moved >= self.length;
                if is_whole && matches!(self.stage, Stage::DataOut(_)) {
                    self.stage = Stage::Idle;
                    return Some(request);
                }
            }
            // The host confirms the data, all of them or those that it wanted.
            Stage::DataIn | Stage::DataInEmpty | Stage::StatusOut => {
                if bus.read(TO_0, &mut []).is_ok() {
                    self.stage = Stage::Idle;
                }
            }
            Stage::Idle | Stage::StatusIn => {
                if bus.read(TO_0, &mut []).is_ok() {
                    self.reject(bus);
                }
            }
        }
        None
    }

    /// Goes on when the host has taken a packet. Returns whether it has confirmed a request.
    pub fn go_on<C: Controller>(&mut self, bus: &Bus<C>) -> bool {
        match self.stage {
            Stage::DataIn => self.send(bus),
            Stage::DataInEmpty => {
                if bus.write(FROM_0, &[]).is_ok() {
                    self.stage = Stage::StatusOut;
                }
            }
            Stage::StatusIn => {
                self.stage = Stage::Idle;
                return true;
            }
            // It was the last packet, or belongs to a transfer that was broken off.
            Stage::Idle | Stage::StatusOut | Stage::DataOut(_) => {}
        }
        false
    }

    /// Begins the data stage of a request that asks for data. If these are longer than there is
    /// room for, the request gets no answer.
    pub fn answer<C: Controller>(
        &mut self,
        bus: &Bus<C>,
        request: &Request,
        data: impl IntoIterator<Item = u8>,
    ) {
        let (mut room, mut count) = (self.data.iter_mut(), 0);
        for byte in data {
            let Some(place) = room.next() else { return };
            *place = byte;
            count += 1;
        }
        self.length = count.min(usize::from(request.length));
        self.moved = 0;
        self.stage = Stage::DataIn;
        self.send(bus);
    }

    /// Sends the next packet of the data.
    fn send<C: Controller>(&mut self, bus: &Bus<C>) {
        let left = self.data.get(self.moved..self.length).unwrap_or_default();
        let packet = left.chunks(PACKET).next().unwrap_or_default();
        if bus.write(FROM_0, packet).is_err() {
            return;
        }
        self.moved += packet.len();
        if self.moved >= self.length {
            let is_full = packet.len() == PACKET;
            self.stage = if is_full { Stage::DataInEmpty } else { Stage::StatusOut };
        }
    }

    /// Begins the status stage of a request that is carried out.
    pub fn confirm<C: Controller>(&mut self, bus: &Bus<C>) {
        if bus.write(FROM_0, &[]).is_ok() {
            self.stage = Stage::StatusIn;
        }
    }

    /// Refuses the request: endpoint 0 stalls until the next one.
    pub fn reject<C: Controller>(&mut self, bus: &Bus<C>) {
        self.stage = Stage::Idle;
        for buffer in [TO_0, FROM_0] {
            bus.set_halted(buffer, true);
        }
    }
}
