#pragma once
#include <functional>
#include <vector>

namespace LAMMPS_NS {

struct Face;
struct Rotation;
struct Shell;
struct Vec;
struct WallOutline;

// What fix free_flight must know of other fixes, and they need not know of it.

// Holds sub-spheres together in bodies, and keeps numbers of each sub-sphere that turn with it.
class BodyMaker {
 public:
  virtual ~BodyMaker() {}
  virtual void let_bodies_leave() = 0;                  // from now on a body that is not in the arrays is no error
  virtual const std::vector<int> &body_of_tag() = 0;    // the least tag of the body of each sub-sphere, by tag
  virtual void add_elastic_energy_by_body(double *energy) = 0;  // of bodies in the arrays, by least tag, J
  // What the bonds of a sub-sphere that hold bear together.
  struct Support {
    double tensile_N = 0, stiffness_N_m = 0;
    int bonds = 0;
  };
  virtual const std::vector<Support> &supports_of_tags() = 0;
  virtual void hold(int tag, bool held) = 0;            // held: its bonds are not computed once they are listed anew
  virtual void take_energy(int tag, double energy) = 0; // counts inner motion as damped by the bonds, J
  // Sub-sphere i leaves at the next build: it is neither turned nor worked on until then.
  virtual void let_leave(int i) = 0;
  virtual void rotate(int i, const Rotation &turned) = 0;  // sub-sphere i has turned while it was away
};

// The plate for what shows it.
class Pushed {
 public:
  virtual ~Pushed() {}
  virtual bool is_pushed() const = 0;  // by a sub-sphere of this rank, now
  virtual std::vector<double> contacts_now() const = 0;  // rows as in contact_recorder.h; all ranks ask together
};

// Something that bodies in free flight can hit: the plate.
class Obstacle {
 public:
  virtual ~Obstacle() {}
  virtual const double *extent() const = 0;  // XMIN XMAX YMIN YMAX, m
  virtual double reach() const = 0;          // bound for its |z| until the next message, m
  // How far what touches may reach below the sub-spheres of a body with these tags, m; and the smooth surface with
  // which it touches as a stone. All of its tags are in the arrays.
  virtual double outside(const std::vector<int> &tags) const = 0;
  virtual Shell surface(const std::vector<int> &tags) const = 0;
  virtual double patch_height() const = 0;  // as in PlateOutline
  // How far a face may lie outside the sub-sphere behind it, m, and those with which sub-sphere i may come to touch.
  virtual double faces_outside() const = 0;
  virtual void add_faces(int i, std::vector<Face> &) = 0;
  virtual int co_step() const = 0;           // steps; time may be skipped in multiples of this
  virtual int longest_message() const = 0;   // steps from one message to the next, at most
  virtual bool is_quiet() const = 0;         // nothing is near it, and no co-step is open
  virtual void skip(long long co_steps) = 0; // so much time has passed without contact; only while it is quiet
  virtual void ask_reach() = 0;              // finds the reach anew; only while it is quiet, at the end of a step
};

// A wall beside the plate.
class SideWall {
 public:
  virtual ~SideWall() {}
  virtual const WallOutline &outline() const = 0;
};

// A fix of the engine that does nothing to bodies in free flight, or of which fix free_flight knows what.
class ActsInFreeFlight {
 public:
  virtual ~ActsInFreeFlight() {}
  virtual int acts_every() const { return 0; }  // steps, while all bodies are in free flight; 0: never
  virtual bool pushes(int) const { return false; }  // the body of this least tag, which therefore does not fly
  virtual void came_back() {}  // some body, which may touch at the next step
};

// Knows of sub-spheres that are not in the arrays.
class FlyingSpheres {
 public:
  virtual ~FlyingSpheres() {}
  // Where each of them is and how it moves now, m and m/s. The flight goes on as if nobody had looked.
  using Visit = std::function<void(int tag, const double *x, const double *v)>;
  virtual void each_in_flight(const Visit &) const = 0;
};

// What the run loop asks of fix free_flight.
class FlightControl {
 public:
  virtual ~FlightControl() {}
  virtual void jump() = 0;           // advances time to just before the next step at which something happens
  virtual bool holds_others() const = 0;  // than at the last build, bodies as rigid
  virtual void change_arrays() = 0;  // between pre_exchange and the build of neighbour lists
  virtual void show() = 0;           // appends bodies in free flight to the arrays if a dump or a restart is due
  virtual void hide() = 0;           // and takes them out again
  virtual void bring_back() = 0;     // all bodies in free flight, for good, at the end of a run
  virtual double body_skin() const = 0;  // of pairs within a body, m; 0: as of all others
};

}  // namespace LAMMPS_NS
