//! Appends moves to the path, and determines how fast the corner before each may be passed.

use super::*;

/// A straight move of the pen, or a segment of one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Move<'c> {
    /// The positions of the motors at its end.
    pub motors: PagePoint,
    /// How far its ends lie beside the points that the motors can reach: see
    /// [`Line::beside`](crate::step::Line::beside).
    pub offsets: [i16; 2],
    /// The position of the pen at its end.
    pub page: PagePoint,
    /// The whole move on the page.
    pub chord: &'c Chord,
    /// The length of this segment of it.
    pub length: PathLength,
    /// Whether this is a gap within an inked line, for which the pen is raised.
    pub is_gap: bool,
}

impl<'c> Move<'c> {
    /// A whole move to a position of the motors and of the pen.
    pub fn whole(motors: PagePoint, page: PagePoint, chord: &'c Chord) -> Self {
        Self { motors, offsets: [0; 2], page, chord, length: chord.length, is_gap: false }
    }
}

/// The reasons why a block was not appended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum PushError {
    /// The look-ahead is full: produce events first.
    Full,
    /// The move is longer than 16 m, which exceeds every page.
    TooLong,
}

/// A displacement on the page with its length and its direction, which cost a square root and a
/// division: [`Runner::chord`] returns it. Rounding to steps leaves few different chords in a
/// curve, so they are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Chord {
    /// The displacement, in steps.
    displacement: (i32, i32),
    length: PathLength,
    heading: Heading,
}

impl Chord {
    /// The displacement on the page, in steps.
    pub const fn displacement(&self) -> (i32, i32) {
        self.displacement
    }

    /// The length on the page.
    pub const fn length(&self) -> PathLength {
        self.length
    }
}

/// What the next move must know of the one before it.
#[derive(Debug, Clone, Copy)]
pub(super) struct LastMove {
    /// The whole move.
    chord: Chord,
    /// The length of the move, which may be a segment of the whole.
    length: PathLength,
    pub(super) ink: Option<LineType>,
}

impl Runner<'_> {
    /// A move by (`dx`, `dy`) steps, each within ±2^22; `None` beyond 16 m.
    pub fn chord(&self, dx: i32, dy: i32) -> Option<Chord> {
        let displacement = (dx, dy);
        if let Some(last) = &self.last
            && last.chord.displacement == displacement
        {
            return Some(last.chord);
        }
        if let Some(chord) = &self.other_chord
            && chord.displacement == displacement
        {
            return Some(*chord);
        }
        let length = self.limits.length(dx, dy)?;
        let heading = Heading::new(&self.limits, dx, dy, length);
        Some(Chord { displacement, length, heading })
    }

    /// Appends a move whose speed is limited by `speed_limit`, and by corners and bends. These and
    /// lengths are measured on the page. A move without length is skipped.
    ///
    /// # Errors
    /// See [`PushError`]; nothing is appended then.
    pub fn push(
        &mut self,
        piece: &Move<'_>,
        ink: Option<LineType>,
        speed_limit: SpeedLimit,
    ) -> Result<(), PushError> {
        let Move { motors, offsets, page, mut chord, mut length, is_gap } = *piece;
        let own;
        let (dx, dy) = (motors.x - self.end.x, motors.y - self.end.y);
        if dx == 0 && dy == 0 {
            // The pen may be only near this point, because the motors move in whole steps.
            self.page_end = page;
            return Ok(());
        }
        if chord.displacement == (0, 0) || length == 0 {
            // The move is shorter than a step on the page, so its direction is that of the motors.
            own = self.chord(dx.signum(), dy.signum()).ok_or(PushError::TooLong)?;
            (chord, length) = (&own, own.length);
        }
        let inked = ink.filter(|_| !is_gap);
        let last = self.last.filter(|last| passes(last.ink, inked));
        let goes_on = last.is_some_and(|last| {
            let [(x, y), (dx, dy)] = [last.chord.displacement, chord.displacement];
            is_in_line([x, y], [dx, dy])
        });
        let corner = match last {
            Some(_) if goes_on => Corner::NONE,
            Some(last) => {
                let (before, shorter) = (last.chord.heading, length.min(last.length));
                junction::corner(&self.limits, before, chord.heading, shorter, PathLength::ZERO)
            }
            None => Corner::STOP,
        };
        if self.lookahead.is_full() {
            return Err(PushError::Full);
        }
        if last.is_none() {
            self.long = None;
        }
        let corner = if LongMove::is_short(length, &self.limits) {
            if self.long.is_some() {
                self.follow_long_move(length);
            }
            corner
        } else {
            self.replace_long_move(chord.heading, length, corner)
        };
        let bends_apart =
            self.last.is_some_and(|last| junction::bends_apart(&self.limits, last.length, length));
        if corner.is_sharp || bends_apart {
            self.curvature.restart(&self.limits, self.page_end, &mut self.lookahead);
        }
        let kind = if is_gap { BlockKind::Gap } else { BlockKind::Line };
        #[cfg(feature = "spread-backlash")]
        let (kind, extra) = core::mem::take(&mut self.backlash_take_up).of_block(kind);
        let block = Block {
            dx,
            dy,
            length,
            entry_limit: corner.limit,
            speed_limit,
            ink,
            offsets,
            kind,
            #[cfg(feature = "spread-backlash")]
            extra,
            ..Block::EMPTY
        };
        // The speed is checked only between blocks, so moves are joined only if nothing limits it
        // there.
        let is_free = corner.limit >= self.limits.top && speed_limit == self.last_limit;
        let is_joined = is_free && self.lookahead.join(&block, goes_on, &self.limits);
        if !is_joined && self.lookahead.push(block).is_err() {
            return Err(PushError::Full);
        }
        self.last_limit = speed_limit;
        if self.limits.centripetal {
            self.curvature.extend(&self.limits, page, &mut self.lookahead);
        }
        self.end = motors;
        self.page_end = page;
        match &mut self.last {
            Some(last) if last.chord.displacement == chord.displacement => {
                (last.length, last.ink) = (length, inked);
            }
            last => {
                if let Some(last) = last {
                    self.other_chord = Some(last.chord);
                }
                *last = Some(LastMove { chord: *chord, length, ink: inked });
            }
        }
        self.follow_path();
        Ok(())
    }

    /// Records a short move behind the last long one.
    #[inline(never)] // Only behind a long move: inlined, it would fill the cache.
    fn follow_long_move(&mut self, length: PathLength) {
        self.long = self.long.and_then(|long| long.followed_by(length, &self.limits));
    }

    /// Records a long move, and returns the corner before it, which is `corner` if short moves
    /// hide none.
    #[inline(never)] // Inlined, it would fill the cache.
    fn replace_long_move(
        &mut self,
        heading: Heading,
        length: PathLength,
        corner: Corner,
    ) -> Corner {
        LongMove::replace(&mut self.long, heading, length, corner, &self.limits)
    }

    /// Appends steps by which the motors take up their backlash, from rest to rest. The pen stays
    /// where it is, and is lowered if there is `ink`. If the pen may move while the machine does,
    /// and these steps come before a stroke, it is still raised.
    ///
    /// # Errors
    /// See [`PushError`]; nothing is appended then.
    pub fn push_backlash(&mut self, by: PagePoint, ink: Option<LineType>) -> Result<(), PushError> {
        let PagePoint { x: dx, y: dy } = by;
        let length = self.limits.length(dx, dy).ok_or(PushError::TooLong)?;
        let ink = ink.map(|_| LineType::Full);
        let block = Block { dx, dy, length, ink, kind: BlockKind::Backlash, ..Block::EMPTY };
        self.end_path();
        self.lookahead.push(block).map_err(|_| PushError::Full)?;
        self.backlash_end.x = self.backlash_end.x.wrapping_add(dx);
        self.backlash_end.y = self.backlash_end.y.wrapping_add(dy);
        Ok(())
    }

    /// The steps in the waiting blocks that take up backlash. [`Runner::forget_path`] discards
    /// them.
    pub fn waiting_backlash(&self) -> PagePoint {
        PagePoint {
            x: self.backlash_end.x.wrapping_sub(self.backlash.x),
            y: self.backlash_end.y.wrapping_sub(self.backlash.y),
        }
    }

    /// For each motor, the sum of the steps that took up backlash at rest; wraps.
    pub fn backlash(&self) -> PagePoint {
        self.backlash
    }

    /// Lowers the pen where the path ends so far.
    ///
    /// # Errors
    /// [`PushError::Full`]; nothing is appended then.
    pub fn push_dot(&mut self) -> Result<(), PushError> {
        let dot = Block { ink: Some(LineType::Full), ..Block::EMPTY };
        self.lookahead.push(dot).map_err(|_| PushError::Full)?;
        self.last = None;
        Ok(())
    }

    /// Ends the path with the last block, and with it a curve.
    pub fn end_path(&mut self) {
        self.curvature.restart(&self.limits, self.page_end, &mut self.lookahead);
        self.last = None;
        self.follow_path();
    }
}

/// Whether the machine may pass from one block to the next without coming to rest.
fn passes(before: Option<LineType>, after: Option<LineType>) -> bool {
    before == after && matches!(after, None | Some(LineType::Full))
}
