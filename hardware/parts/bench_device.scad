// Printed parts of the bench device, in mm, in their print orientation; "assembly" shows them in place. One part per
// file:  openscad -D 'part="pipe_end"' -o pipe_end.stl bench_device.scad
//
// Frame of the assembly: x along the wire, distal positive; y to the operator's left; z up; the
// origin on the pipe's axis in the middle of the window.
part = "assembly";
cut = false;  // removes the half distal of the window's middle, to show the inside

/* [Wire and cylinder] */
cylinder_radius = 5;      // including its paper; the radius of the calibration
cylinder_length = 170;
pipe_length = 320;        // travel is pipe_length - cylinder_length
wire_diameter = 0.9;      // 0.035 inch is 0.89; thinner wires get a sleeve of this diameter
paper_thickness = 0.1;    // one layer of matt paper around the printed core

/* [Pipe] */
bore_clearance = 0.15;    // radial
pipe_wall = 1.9;
window_length = 14;       // must be below 2 cylinder_length - pipe_length
window_width = 9;
middle_length = 60;       // the part with the window
socket_depth = 12;        // depth to which an end of the pipe enters it
fit = 0.15;               // radial, between printed parts that are glued
vent_count = 6;           // in each cap, so that the cylinder is not a piston
vent_diameter = 2.4;

/* [End switch, optional: a plunger switch of the D2F size; measure yours] */
end_switch = false;
switch_length = 13;       // body, with room
switch_thickness = 6;
switch_height = 6.5;
switch_wall = 0.6;        // of the cap, below the plunger
switch_plunger_x = 2.5;   // plunger's hole, from the body's middle
switch_plunger_y = 4.2;   // from the wire

/* [Sensor module: measure yours] */
focus_low = 2.2;          // lens reference plane to surface: range of the PMW3360
focus_high = 2.6;
lens_to_surface = 2.55;   // with the cylinder resting on the floor of the bore by its weight
focus_step = 0.1;         // step of the height adjustment: shims, and sheets of paper
lens_height = 3.4;        // lens reference plane below the board's underside
shim_thickness = 0.2;
shims_fitted = 2;         // below the carrier, so that it can be lowered as well as raised
board_x = 28.3;           // the module's long side, along the wire, so that the light falls along it too
board_y = 21.1;           // its short side, across
board_z = 1.6;
board_lens_x = 13.6;      // optical center from one end of the long side
lens_x = 21.3;
lens_y = 18.9;
align_angle = 3;          // the carrier turns by this much either way, degrees

/* [Leaf springs: they press the cylinder on the floor of its bore, from both sides of the window] */
leaf_x = 14.6;            // of their middle, along the wire
leaf_width = 5;
leaf_length = 14;         // from the nub's middle to the foot
leaf_thickness = 0.45;    // one line of the printer; measure yours
leaf_deflection = 1;      // with the cylinder at rest and the shims as drawn
leaf_gap = 0.5;           // above the leaf, for its way up
leaf_pocket = 4.4;        // depth in the carrier
foot_length = 8;
foot_height = 3;
lens_ledge = 0.6;         // overlap of the carrier's ledges with the lens

/* [Catheter, panel] */
catheter_diameter = 2.4;  // 7 French is 2.33
catheter_grip = 30;       // depth of the catheter in its hollow cylinder, for two sensors
passage_diameter = 2;     // of that cylinder beyond, through which the wire passes
button_hole = 16.2;
jack_hole = 6.2;
joystick_hole = 26;
joystick_screws = [20, 26];  // distances; the panel has slots, because modules differ
stick_height = 25;

/* [Screws] */
m3_hole = 3.4;
m3_pilot = 2.6;           // an M3 screw cuts its thread in the plastic

$fn = 64;
e = 0.01;

travel = pipe_length - cylinder_length;
bore_radius = cylinder_radius + bore_clearance;
pipe_radius = bore_radius + pipe_wall;
end_length = (pipe_length - middle_length) / 2 + socket_depth;
block_width = 50;
block_top = 4;
block_bottom = -12;
carrier_screws = [24, 19];
block_screws = [16, 20];
axis_height = 30;         // above the table
box_length = 146;         // one half; the caps stay outside
box_width = 72;
wall = 2.4;
end_wall = 6;

// Height of the lens above the pipe's axis. hardware/budget.py reads these lines, which are the only source for the
// focus. The cylinder lies on the floor of its bore, so its crest is lower by the clearance. Lifted to the ceiling, it
// is higher by twice the clearance.
crest_at_rest = cylinder_radius - bore_clearance;
crest_lifted = crest_at_rest + 2 * bore_clearance;
lens_plane = crest_at_rest + lens_to_surface;
board_seat = lens_plane + lens_height;               // the board's underside
carrier_bottom = block_top + shims_fitted * shim_thickness;
seat_in_carrier = board_seat - carrier_bottom;
crown_flat = lens_plane - (shims_fitted + 1) * shim_thickness - 0.2;  // of the pipe, below the lens
farthest_surface = lens_to_surface + focus_step / 2;  // with the height set as well as the steps allow
nearest_surface = lens_plane - crest_lifted - focus_step / 2;

assert(window_length < 2 * cylinder_length - pipe_length, "the cylinder must always fill the window");
assert(farthest_surface <= focus_high && nearest_surface >= focus_low - e,
       "somewhere in its play the surface would leave the sensor's range of focus");
// Nub of a leaf spring that is not bent: it ends below the crest by the deflection.
nub_height = carrier_bottom + leaf_pocket - leaf_gap - leaf_thickness - crest_at_rest;
ledge_top = seat_in_carrier - lens_height - 0.1;  // in the carrier; the lens rests on its board, not on the ledges

assert(leaf_gap > 2 * bore_clearance, "a lifted cylinder would bend the springs to the carrier");
assert(leaf_pocket < seat_in_carrier - 1.5, "the springs' pocket would reach the board");
assert(crown_flat > bore_radius + 0.8, "the lens would touch the pipe");
// The caps keep the wire within 0.3 mm of the pipe's axis; the hollow cylinder lies on the floor of its bore or is raised.
passage_play = (passage_diameter - wire_diameter) / 2;
assert(passage_play > bore_clearance + 0.3, "the hollow cylinder would rest on the wire");
assert(passage_diameter < catheter_diameter, "the catheter would slip through its cylinder");
assert(board_lens_x > lens_x / 2 && board_x - board_lens_x > lens_x / 2, "the board must carry the lens");

module slab(x, y, z) { translate([-x / 2, -y / 2, 0]) cube([x, y, z]); }
module each_corner(x, y) { for (i = [-1, 1], j = [-1, 1]) translate([i * x, j * y, 0]) children(); }

// --- moving parts ---------------------------------------------------------------------------

core_radius = cylinder_radius - paper_thickness;
module core_blank() {
  cylinder(r1 = core_radius - 0.6, r2 = core_radius, h = 0.6 + e);
  translate([0, 0, 0.6]) cylinder(r = core_radius, h = cylinder_length - 1.2);
  translate([0, 0, cylinder_length - 0.6 - e]) cylinder(r1 = core_radius, r2 = core_radius - 0.6, h = 0.6 + e);
}

// The core of the cylinder, to be wrapped in paper. Print upright, with a brim.
module cylinder_core() {
  r = core_radius;
  difference() {
    core_blank();
    translate([0, 0, -1]) cylinder(d = wire_diameter + 0.2, h = cylinder_length + 2, $fn = 24);
    // A headless M3 screw holds the wire at the proximal end; it stays below the surface.
    translate([0, 0, 4.5]) rotate([0, 90, 0]) cylinder(d = m3_pilot, h = r + 1, $fn = 24);
  }
}

// Core of the catheter's cylinder, hollow, to be wrapped in paper. The catheter is glued into the proximal end, at
// z = 0. The wire leaves it inside and passes through. Print upright, with a brim.
module catheter_core() {
  seat = catheter_diameter + 0.2;
  difference() {
    core_blank();
    translate([0, 0, -1]) cylinder(d = passage_diameter, h = cylinder_length + 2, $fn = 24);
    translate([0, 0, -1]) cylinder(d = seat, h = catheter_grip + 1, $fn = 24);
    translate([0, 0, catheter_grip - e]) cylinder(d1 = seat, d2 = passage_diameter, h = 1, $fn = 24);
    // Funnel for a wire that is threaded from the distal end.
    translate([0, 0, cylinder_length - 3]) cylinder(d1 = passage_diameter, d2 = passage_diameter + 3, h = 3 + e, $fn = 24);
    for (z = [8, catheter_grip - 8]) translate([0, 0, z]) rotate([0, 90, 0])  // for the glue
      cylinder(d = 1.5, h = core_radius + 1, $fn = 24);
  }
}

// --- guiding parts --------------------------------------------------------------------------

module pipe_end() {
  difference() {
    cylinder(r = pipe_radius, h = end_length);
    translate([0, 0, -1]) cylinder(r = bore_radius, h = end_length + 2);
    // Lead-in, so that the cylinder does not catch at the joint.
    translate([0, 0, -e]) cylinder(r1 = bore_radius + 0.5, r2 = bore_radius, h = 0.8);
  }
}

// End stop: a cup on the pipe's end, with a hole for the wire and vents around it.
cap_wall = 3;
vent_radius = bore_radius - vent_diameter / 2 - 0.2;  // of the circle of vents
module pipe_cap(through = wire_diameter) {
  difference() {
    cylinder(r = pipe_radius + 2.4, h = 10 + cap_wall);
    translate([0, 0, cap_wall]) cylinder(r = pipe_radius + fit, h = 11);
    cap_openings(vent_count, through);
  }
}
// `through` is the diameter of the wire or catheter.
module cap_openings(vents, through = wire_diameter) {
  translate([0, 0, -1]) cylinder(d = through + 0.6, h = cap_wall + 2, $fn = 24);
  translate([0, 0, -e]) cylinder(d1 = wire_diameter + 4, d2 = through + 0.6, h = 2, $fn = 24);
  for (i = [0 : 1 : vents - 1]) rotate(-30 - 60 * i) translate([vent_radius, 0, -1])
    cylinder(d = vent_diameter, h = cap_wall + 2, $fn = 24);
}

// Proximal cap with a place for an end switch, which the fully retracted cylinder presses. The switch lies beside the
// wire, with its plunger in the hole.
switch_block = switch_height - cap_wall + switch_wall;  // beyond the cap's wall
module pipe_cap_switch() {
  translate([0, 0, switch_block]) difference() {
    union() {
      cylinder(r = pipe_radius + 2.4, h = 10 + cap_wall);
      translate([-switch_length / 2 - 1.6, -3, -switch_block])
        cube([switch_length + 3.2, switch_plunger_y + switch_thickness / 2 + 4.6, switch_block + cap_wall]);
    }
    translate([0, 0, cap_wall]) cylinder(r = pipe_radius + fit, h = 11);
    cap_openings(3);  // those beside the switch
    translate([0, 0, -switch_block - 1]) cylinder(d = wire_diameter + 0.6, h = 20, $fn = 24);
    translate([-switch_length / 2, switch_plunger_y - switch_thickness / 2, -switch_block - 1])
      cube([switch_length, switch_thickness, switch_block + cap_wall - switch_wall + 1]);
    translate([switch_plunger_x, switch_plunger_y, -1]) cylinder(d = 2.4, h = cap_wall + 2, $fn = 24);
  }
}

// Middle of the pipe, with the window and the flat for the alignment of the carrier. In the frame of the assembly;
// printed in this orientation.
module pipe_middle() {
  difference() {
    union() {
      translate([0, 0, block_bottom]) slab(middle_length, block_width, block_top - block_bottom);
      rotate([0, 90, 0]) cylinder(r = pipe_radius, h = middle_length, center = true);
    }
    rotate([0, 90, 0]) cylinder(r = bore_radius, h = middle_length + 2, center = true);
    for (s = [-1, 1]) scale([s, 1, 1]) {
      translate([middle_length / 2 - socket_depth, 0, 0]) rotate([0, 90, 0])
        cylinder(r = pipe_radius + fit, h = socket_depth + 1);
      translate([middle_length / 2 - socket_depth - 0.8, 0, 0]) rotate([0, 90, 0])
        cylinder(r1 = bore_radius, r2 = bore_radius + 0.5, h = 0.8 + e);
    }
    translate([0, 0, bore_radius / 2]) slab(window_length, window_width, pipe_radius);
    // Slots for the nubs of the leaf springs.
    for (s = [-1, 1]) translate([s * leaf_x, 0, bore_radius / 2]) slab(leaf_width + 0.8, 6, pipe_radius);
    // The crown is flat below the lens, which would touch it at the lowest setting.
    translate([0, 0, crown_flat]) slab(lens_x + 2, lens_y + 2, pipe_radius);
    each_corner(carrier_screws[0], carrier_screws[1])
      translate([0, 0, block_top - 10]) cylinder(d = m3_pilot, h = 11, $fn = 24);
    each_corner(block_screws[0], block_screws[1])
      translate([0, 0, block_bottom - 1]) cylinder(d = m3_pilot, h = 9, $fn = 24);
  }
}

// Holds the sensor's board over the window: its height sets the focus, its slots the alignment. Drawn with its
// underside at z = 0. Print upside down.
carrier_height = seat_in_carrier + board_z;
module sensor_carrier() {
  difference() {
    slab(middle_length, block_width, carrier_height);
    // Room for the crown of the pipe and for the lens.
    translate([0, 0, -1])
      slab(middle_length + 2, 2 * pipe_radius + 1.5, pipe_radius - block_top + 1.6);
    lens_hole();
    for (s = [-1, 1]) translate([s * leaf_x - (leaf_width + 0.4) / 2, -3, -1])
      cube([leaf_width + 0.4, 3 + leaf_length + foot_length + 0.2, leaf_pocket + 1]);
    // The board lies in a recess, its top flush, so that washers hold it at its edges.
    translate([-(board_lens_x + 0.2), -(board_y + 0.4) / 2, seat_in_carrier])
      cube([board_x + 0.4, board_y + 0.4, board_z + 1]);
    for (j = [-1, 1], x = [-9, 9])
      translate([x, j * (board_y / 2 + 2.4), 2]) cylinder(d = m3_pilot, h = carrier_height, $fn = 24);
    // Slots around the optical axis.
    each_slot() translate([0, 0, -1]) cylinder(d = m3_hole, h = carrier_height + 2, $fn = 24);
    // Exit of the cable.
    translate([middle_length / 2, 0, seat_in_carrier]) slab(middle_length, board_y - 2, board_z + 1);
  }
}
// Around the lens, with ledges below its corners, beside the pipe's crown: a lens that comes off its board stays.
module lens_hole() {
  difference() {
    translate([0, 0, -1]) slab(lens_x + 0.8, lens_y + 0.8, carrier_height + 2);
    for (i = [-1, 1], j = [-1, 1])
      translate([i * (lens_x / 2 + 0.4 - (lens_ledge + 0.4) / 2), j * (lens_y / 2 + 0.4 - 2), ledge_top - 1.2])
        slab(lens_ledge + 0.4 + 2 * e, 4 + 2 * e, 1.2);
  }
}

// Leaf spring in the frame of its side view: y grows from the nub to the foot, z up from the foot's top. The free leaf
// slopes down to its nub by the deflection. Print it lying on its side, of PETG; glue the foot into the carrier.
module leaf_profile() {
  polygon([[leaf_length + foot_length, 0], [leaf_length, 0], [leaf_length, -leaf_gap],
           [-1, -leaf_gap - leaf_deflection], [-1, -leaf_gap - leaf_deflection - leaf_thickness - nub_height + 0.6],
           [-0.5, -leaf_gap - leaf_deflection - leaf_thickness - nub_height],
           [0.5, -leaf_gap - leaf_deflection - leaf_thickness - nub_height],
           [1, -leaf_gap - leaf_deflection - leaf_thickness - nub_height + 0.6],
           [1, -leaf_gap - leaf_deflection * (1 - 1 / leaf_length) - leaf_thickness],
           [leaf_length, -leaf_gap - leaf_thickness], [leaf_length, -foot_height],
           [leaf_length + foot_length, -foot_height]]);
}
module leaf_spring() { linear_extrude(leaf_width) leaf_profile(); }

module each_slot() {
  for (i = [-1, 1], j = [-1, 1])
    hull() for (a = [-align_angle, 0, align_angle])
      rotate(a) translate([i * carrier_screws[0], j * carrier_screws[1], 0]) children();
}

// A shim below the carrier: one less or one more sets the focus.
module carrier_shim() {
  difference() {
    slab(middle_length, block_width, shim_thickness);
    translate([0, 0, -1]) slab(middle_length + 2, 2 * pipe_radius + 3, 3);
    each_slot() translate([0, 0, -1]) cylinder(d = m3_hole, h = 3, $fn = 24);
  }
}

// --- supporting parts -----------------------------------------------------------------------

// One half of the box; the other is the same, turned around. Joint at x = 0, end at x = box_length.
module support_box() {
  difference() {
    union() {
      translate([0, -box_width / 2, 0]) cube([box_length, box_width, wall]);
      for (s = [-1, 1])
        translate([0, s > 0 ? box_width / 2 - wall : -box_width / 2, 0]) cube([box_length, wall, 20]);
      translate([0, -box_width / 2, 0]) cube([5, box_width, 14]);
      translate([box_length - end_wall, -box_width / 2, 0]) cube([end_wall, box_width, axis_height + 3]);
      // Pedestal for the pipe's middle.
      translate([block_screws[0] - 8, -block_width / 2, 0])
        cube([16, block_width, axis_height + block_bottom]);
    }
    // Saddle of the pipe.
    translate([box_length - end_wall - 1, 0, axis_height]) rotate([0, 90, 0])
      cylinder(r = pipe_radius + fit, h = end_wall + 2);
    translate([box_length - end_wall - 1, -pipe_radius * 0.85, axis_height])
      cube([end_wall + 2, pipe_radius * 1.7, 20]);
    // Screws: pedestal to pipe from below, half to half, catheter clamp to the end.
    for (s = [-1, 1]) {
      translate([block_screws[0], s * block_screws[1], -1]) cylinder(d = m3_hole, h = 40, $fn = 24);
      translate([block_screws[0], s * block_screws[1], -1])
        cylinder(d = 6.5, h = axis_height + block_bottom - 5 + 1, $fn = 24);
      translate([-1, s * 28, 8]) rotate([0, 90, 0]) cylinder(d = m3_hole, h = 8, $fn = 24);
      translate([box_length - end_wall - 1, s * 20, 20]) rotate([0, 90, 0])
        cylinder(d = m3_pilot, h = end_wall + 2, $fn = 24);
    }
    // Room under the pipe for wires from one half to the other, and out at the side.
    translate([-1, -9, wall]) cube([30, 18, 12]);
    translate([60, box_width / 2 - wall - 1, 8]) cube([14, wall + 2, 20]);
  }
}

// Lower part of the catheter's clamp, at the proximal end of the box, around the cap. x = 0 at the end wall, growing
// away from it; z = 0 on the axis.
clamp_cavity = pipe_length / 2 + cap_wall - box_length + 3
  + (end_switch ? switch_block : 0);  // the cap, and room for a finger nail
clamp_length = clamp_cavity + 24;
module catheter_clamp() {
  difference() {
    union() {
      translate([0, -26, -18]) cube([5, 52, 18]);
      translate([0, -14, -18]) cube([clamp_length, 28, 18]);
    }
    translate([-1, 0, 0]) rotate([0, 90, 0]) cylinder(r = pipe_radius + 3.2, h = clamp_cavity + 1);
    translate([-1, 0, 0]) rotate([0, 90, 0])
      cylinder(d = catheter_diameter, h = clamp_length + 2, $fn = 32);
    for (s = [-1, 1]) {
      translate([-1, s * 20, -10]) rotate([0, 90, 0]) cylinder(d = m3_hole, h = 8, $fn = 24);
      translate([clamp_cavity + 12, s * 9, -12]) cylinder(d = m3_pilot, h = 13, $fn = 24);
    }
  }
}

// Lid of the clamp, printed upside down. The groove is 0.2 mm shallower, so that it grips.
module catheter_lid() {
  difference() {
    translate([clamp_cavity + 2, -14, 0]) cube([22, 28, 6]);
    translate([0, 0, -0.2]) rotate([0, 90, 0])
      cylinder(d = catheter_diameter, h = clamp_length + 2, $fn = 32);
    for (s = [-1, 1])
      translate([clamp_cavity + 12, s * 9, -1]) cylinder(d = m3_hole, h = 8, $fn = 24);
  }
}

// Joins two boxes end to end, so that their caps meet: the catheter's box, then the wire's. In the frame of the clamp.
link_length = 2 * (pipe_length / 2 + cap_wall - box_length) + 1;
module box_link() {
  difference() {
    union() {
      for (x = [0, link_length - 5]) translate([x, -26, -18]) cube([5, 52, 18]);
      translate([0, -14, -18]) cube([link_length, 28, 18]);
    }
    translate([-1, 0, 0]) rotate([0, 90, 0]) cylinder(r = pipe_radius + 3.2, h = link_length + 2);
    for (s = [-1, 1]) translate([-1, s * 20, -10]) rotate([0, 90, 0])
      cylinder(d = m3_hole, h = link_length + 2, $fn = 24);
  }
}

// Joystick and buttons; a lid without a bottom, standing on the table. Print face down.
panel = [120, 76, 34];
module control_panel() {
  difference() {
    translate([0, 0, 0]) slab(panel[0], panel[1], panel[2]);
    translate([0, 0, -wall]) slab(panel[0] - 2 * wall, panel[1] - 2 * wall, panel[2]);
    translate([-28, 0, 0]) {
      cylinder(d = joystick_hole, h = panel[2] + 1);
      each_corner(joystick_screws[0] / 2, joystick_screws[1] / 2)
        translate([0, 0, panel[2] - 5]) hull() for (d = [-2, 2])
          translate([d, 0, 0]) cylinder(d = m3_hole, h = 7, $fn = 24);
    }
    for (y = [-17, 17]) translate([28, y, 0]) cylinder(d = button_hole, h = panel[2] + 1);
    // Pedal's jack and the cable, at the back.
    translate([28, panel[1] / 2 - wall - 1, panel[2] / 2]) rotate([-90, 0, 0])
      cylinder(d = jack_hole, h = wall + 2, $fn = 32);
    translate([-28, panel[1] / 2, -e]) slab(8, 3 * wall, 6);
  }
}

// --- assembly -------------------------------------------------------------------------------

module assembly_piece(name) {
  if (name == "placed_support_box") {
    for (s = [-1, 1]) rotate(s > 0 ? 0 : 180) translate([0, 0, -axis_height]) support_box();
  } else if (name == "placed_pipe") {
    pipe_middle();
    for (s = [-1, 1]) rotate(s > 0 ? 0 : 180)
      translate([middle_length / 2 - socket_depth, 0, 0]) rotate([0, 90, 0]) pipe_end();
  } else if (name == "placed_caps") {
    translate([pipe_length / 2 + cap_wall, 0, 0]) rotate([0, -90, 0]) pipe_cap();
    if (end_switch)
      translate([-pipe_length / 2 - cap_wall - switch_block, 0, 0]) rotate([0, 90, 0]) rotate(-90)
        pipe_cap_switch();
    else translate([-pipe_length / 2 - cap_wall, 0, 0]) rotate([0, 90, 0]) pipe_cap();
  } else if (name == "placed_cylinder") {
    translate([-cylinder_length / 2, 0, -bore_clearance]) rotate([0, 90, 0]) cylinder_core();
  } else if (name == "placed_sensor_carrier") {
    translate([0, 0, carrier_bottom]) sensor_carrier();
    for (i = [1 : 1 : shims_fitted]) translate([0, 0, block_top + (i - 1) * shim_thickness]) carrier_shim();
  } else if (name == "placed_leaf_springs") {  // not bent: their nubs reach into the cylinder by the deflection
    for (s = [-1, 1]) translate([s * leaf_x - leaf_width / 2, 0, carrier_bottom + leaf_pocket])
      rotate([90, 0, 90]) leaf_spring();
  } else if (name == "placed_sensor_board") {
    translate([-board_lens_x, -board_y / 2, board_seat]) cube([board_x, board_y, board_z]);
    translate([0, 0, lens_plane]) slab(lens_x, lens_y, lens_height);
    translate([1, 0, board_seat + board_z - e]) slab(15.6, 10, 2.5);
  } else if (name == "placed_catheter_clamp") {
    translate([-box_length, 0, 0]) rotate(180) { catheter_clamp(); translate([0, 0, 0.4]) catheter_lid(); }
  } else if (name == "placed_control_panel") {
    translate([0, -110, -axis_height]) control_panel();
  } else if (name == "placed_wire") {
    translate([-box_length - 130, 0, -bore_clearance]) rotate([0, 90, 0])
      cylinder(d = wire_diameter, h = box_length + 130 - cylinder_length / 2 + 40, $fn = 16);
  }
}

if (part == "cylinder_core") cylinder_core();
else if (part == "catheter_core") catheter_core();
else if (part == "pipe_cap_catheter") pipe_cap(catheter_diameter);
else if (part == "box_link") translate([0, 0, 18]) box_link();
else if (part == "pipe_end") pipe_end();
else if (part == "pipe_cap") pipe_cap();
else if (part == "pipe_cap_switch") pipe_cap_switch();
else if (part == "pipe_middle") translate([0, 0, -block_bottom]) pipe_middle();
else if (part == "sensor_carrier") translate([0, 0, carrier_height]) rotate([180, 0, 0]) sensor_carrier();
else if (part == "carrier_shim") carrier_shim();
else if (part == "leaf_spring")
  translate([0, leaf_gap + leaf_deflection + leaf_thickness + nub_height, 0]) leaf_spring();
else if (part == "support_box") support_box();
else if (part == "catheter_clamp") translate([0, 0, 18]) catheter_clamp();
else if (part == "catheter_lid") translate([0, 0, 6]) rotate([180, 0, 0]) catheter_lid();
else if (part == "control_panel") translate([0, 0, panel[2]]) rotate([180, 0, 0]) control_panel();
else if (part == "assembly")
  for (name = ["support_box", "pipe", "caps", "cylinder", "leaf_springs", "sensor_carrier", "sensor_board",
               "catheter_clamp", "control_panel", "wire"])
    assembly_piece(str("placed_", name));
else if (cut) intersection() {
  assembly_piece(part);
  translate([-100, -100, -100]) cube([100, 200, 200]);
}
else assembly_piece(part);
