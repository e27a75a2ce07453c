// Stand-ins for the parts of the text that a scene leaves out. They are never called: the march asks the define before it calls
// a part, and so reads the same in GLSL, which holds only what the scene needs, and in C++, which holds everything.
#if !AMRTEX_CPP
#if AMRTEX_ISOVALUES == 0
int isovalues_below(IN(real) value) { return 0; }
bool on_one_side(IN(Accumulation) a, IN(vec2r) value_range) { return true; }
void note_side(INOUT(Accumulation) a, IN(bool) missing, IN(real) value, IN(ray_real) begin, IN(ray_real) at) {}
bool surfaces_ended(IN(Accumulation) a) { return false; }
vec4r surface_picture(IN(Accumulation) a) { return vec4r(0); }
#endif

#if AMRTEX_SHADOWS == 0
Position place_of(IN(Region) r, IN(vec3r) q) { return Position(ivec3(0), vec3r(0)); }
void accumulate_lit(INOUT(Accumulation) a, IN(real) value, IN(real) length, IN(Position) p) {}
#endif

#if !AMRTEX_SEVERAL_FIELDS
bool fields_visible(IN(Region) r) { return true; }
void take_fields(INOUT(Accumulation) a, IN(Region) r, IN(vec3r) q, IN(real) length) {}
#endif

#if AMRTEX_INTEGRATOR < AMRTEX_INTEGRATOR_PREINTEGRATED
void take_point(INOUT(Accumulation) a, IN(bool) missing, IN(real) value, IN(real) length) {}
#endif

#if AMRTEX_INTEGRATOR != AMRTEX_INTEGRATOR_TOLERANCE
void open_account(INOUT(Accumulation) a, IN(real) whole, IN(real) begin, IN(real) part) {}
void march_tolerance_region(INOUT(Accumulation) a, IN(Region) r, IN(vec3r) q0, IN(vec3r) dq, IN(real) length, IN(real) begin,
                            IN(real) least) {}
#endif
#endif
