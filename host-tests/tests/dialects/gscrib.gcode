G21 ; Set length units, millimeters
G90 ; Set distance mode, absolute
F2000
G0 X10 Y70
S1000 M03 ; Start tool, clockwise
G1 X40 Y70
G1 X25 Y45
G1 X10 Y70
M05 ; Stop tool
G0 X50 Y60
S1000 M03 ; Start tool, clockwise
G1 X60 Y50
G1 X70 Y60
G1 X80 Y50
G1 X90 Y60
M05 ; Stop tool
G0 X20 Y30
S1000 M03 ; Start tool, clockwise
G1 X20 Y10
G1 X45 Y10
M05 ; Stop tool
G0 X60.5 Y34.75
S1000 M03 ; Start tool, clockwise
G1 X60.5 Y14.25
G1 X85.125 Y14.25
G1 X85.125 Y34.75
G1 X60.5 Y34.75
M05 ; Stop tool
M02 ; End of program, no reset
