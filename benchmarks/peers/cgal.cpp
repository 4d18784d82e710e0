// CGAL's Loop on a Surface_mesh.
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/subdivision_method_3.h>

#include "driver.hpp"

using Kernel = CGAL::Simple_cartesian<double>;
using Mesh = CGAL::Surface_mesh<Kernel::Point_3>;

Arrays subdivide(const Arrays& in, int levels) {
    Mesh mesh;
    mesh.reserve(in.vertex_count(), 3 * in.face_count() / 2, in.face_count());
    for (std::size_t v = 0; v < in.vertex_count(); ++v)
        mesh.add_vertex({in.points[3 * v], in.points[3 * v + 1], in.points[3 * v + 2]});
    for (std::size_t f = 0; f < in.face_count(); ++f)
        mesh.add_face(Mesh::Vertex_index(in.faces[3 * f]), Mesh::Vertex_index(in.faces[3 * f + 1]),
                      Mesh::Vertex_index(in.faces[3 * f + 2]));
    CGAL::Subdivision_method_3::Loop_subdivision(
        mesh, CGAL::parameters::number_of_iterations(levels));
    Arrays out;
    out.points.reserve(3 * mesh.number_of_vertices());
    out.faces.reserve(3 * mesh.number_of_faces());
    for (const auto v : mesh.vertices())
        for (int k = 0; k < 3; ++k) out.points.push_back(mesh.point(v)[k]);
    for (const auto f : mesh.faces())
        for (const auto v : vertices_around_face(mesh.halfedge(f), mesh)) out.faces.push_back(v);
    return out;
}

int main(int count, char** arguments) { return serve(count, arguments, subdivide); }
