!> What oil or gas does in a cylinder: flow over the edges of its valve, and how fast the pressures of its chambers change by it.
!>
!> An edge lets Q = K d/(d^2 + d0^2)^(1/4) through at the drop d, which is K sqrt(d) but for small drops, where flow goes with the
!> drop, as in a slit: a root would have no slope there. Of the four edges two are open, as far as the valve is: supply to head and
!> rod chamber to tank, or the other way round.
!>
!> A chamber of the volume V that takes in Q while its piston leaves it room at the rate A v changes its pressure by
!> p' = B/V (Q - A v). B is the oil's bulk modulus, or less where air is in it, which gives way the more the lower the pressure is:
!> from the volume (1 - a) exp(-p/B0) + a (p0/(p0 + p))^(1/n) that both take at the pressure p above the atmosphere's p0.
!>
!> Flow of gas is told in the volume that it has at the reference pressure pr of ISO 6358: an edge of the conductance C lets
!> Q = C pu f through from the pressure pu to pd, absolute ones, f = sqrt(1 - ((pd/pu - b)/(1 - b))^2), or 1 below the critical
!> ratio b of both. Where they are all but the same it goes with their difference, as the standard has it. A chamber of gas that
!> changes by the polytropic exponent n has p' = n/V (pr Q - p A v): what flows in is as warm as the reference.
module linkdyn_cylinder_laws
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: cylinder_spec
    implicit none (type, external)
    private
    public :: cylinder_force, valve_flows, pressure_rates, holding_pressures, oil_stiffness, is_within_stroke, is_pressed

    real(wp), parameter :: atmosphere = 101325         !! [Pa]
    real(wp), parameter :: adiabatic = 1.4_wp          !! exponent n of air that is compressed quickly
    real(wp), parameter :: reference = 1.0e5_wp        !! pressure by which flows of gas are told [Pa]
    real(wp), parameter :: laminar = 0.999_wp          !! ratio of pressures beyond which flows go with the difference

contains

    !> Volumes of head and rod chamber at a place of the joint variable.
    pure function chamber_volumes(cylinder, place) result(volume)
        type(cylinder_spec), intent(in) :: cylinder
        real(wp), intent(in) :: place                  !! [m]
        real(wp) :: volume(2)                          !! [m3]
        real(wp) :: way

        way = direction(cylinder)*(place - cylinder%stroke(1))
        volume(1) = cylinder%dead_volume(1) + cylinder%area(1)*way
        volume(2) = cylinder%dead_volume(2) + cylinder%area(2)*(abs(cylinder%stroke(2) - cylinder%stroke(1)) - way)
    end function chamber_volumes

    !> 1 if the joint variable grows while the rod comes out, else -1.
    pure real(wp) function direction(cylinder)
        type(cylinder_spec), intent(in) :: cylinder

        direction = sign(1.0_wp, cylinder%stroke(2) - cylinder%stroke(1))
    end function direction

    !> Up along the joint variable.
    pure real(wp) function cylinder_force(cylinder, pressure) result(force)
        type(cylinder_spec), intent(in) :: cylinder
        real(wp), intent(in) :: pressure(2)            !! [Pa]

        force = direction(cylinder)*(pressure(1)*cylinder%area(1) - pressure(2)*cylinder%area(2))
    end function cylinder_force

    !> Through the valve into head and rod chamber. An opening beyond -1 to 1 is none.
    pure function valve_flows(cylinder, opening, pressure) result(flow)
        type(cylinder_spec), intent(in) :: cylinder
        real(wp), intent(in) :: opening                !! above zero the rod comes out
        real(wp), intent(in) :: pressure(2)            !! [Pa]
        real(wp) :: flow(2)                            !! [m3/s]
        real(wp) :: open

        open = opening
        ! what is no number stays none
        if (open > 1) open = 1
        if (open < -1) open = -1
        if (open >= 0) then
            flow(1) = open*edge_flow(cylinder, cylinder%supply, pressure(1))
            flow(2) = open*edge_flow(cylinder, cylinder%tank, pressure(2))
        else
            flow(1) = -open*edge_flow(cylinder, cylinder%tank, pressure(1))
            flow(2) = -open*edge_flow(cylinder, cylinder%supply, pressure(2))
        end if
    end function valve_flows

    !> Over an edge that is wide open, from one pressure to the other.
    pure real(wp) function edge_flow(cylinder, from, to) result(flow)
        type(cylinder_spec), intent(in) :: cylinder
        real(wp), intent(in) :: from, to               !! [Pa]

        if (cylinder%has_gas) then
            flow = gas_flow(cylinder, atmosphere + from, atmosphere + to)
        else
            flow = oil_flow(cylinder, from - to)
        end if
    end function edge_flow

    !> Flow of gas through an orifice between two absolute pressures.
    pure real(wp) function gas_flow(cylinder, from, to) result(flow)
        type(cylinder_spec), intent(in) :: cylinder
        real(wp), intent(in) :: from, to               !! [Pa]
        real(wp) :: ratio

        ratio = min(from, to)/max(from, to)
        flow = sign(cylinder%conductance*max(from, to), from - to)
        if (ratio > laminar) then
            flow = flow*subsonic(laminar)*(1 - ratio)/(1 - laminar)
        else if (ratio > cylinder%critical_ratio) then
            flow = flow*subsonic(ratio)
        end if

    contains

        pure real(wp) function subsonic(ratio)
            real(wp), intent(in) :: ratio

            associate (b => cylinder%critical_ratio)
                subsonic = sqrt(1 - ((ratio - b)/(1 - b))**2)
            end associate
        end function subsonic
    end function gas_flow

    !> Flow of oil; the rated one at the rated drop.
    pure real(wp) function oil_flow(cylinder, drop) result(flow)
        type(cylinder_spec), intent(in) :: cylinder
        real(wp), intent(in) :: drop                   !! [Pa]

        flow = cylinder%flow*slit(drop)/slit(cylinder%drop)

    contains

        pure real(wp) function slit(d)
            real(wp), intent(in) :: d

            slit = d/sqrt(hypot(d, cylinder%laminar_drop))
        end function slit
    end function oil_flow

    !> Rates of the pressures in head and rod chamber.
    pure function pressure_rates(cylinder, flow, pressure, place, speed) result(rate)
        type(cylinder_spec), intent(in) :: cylinder
        real(wp), intent(in) :: flow(2)                !! through the valve [m3/s]
        real(wp), intent(in) :: pressure(2)            !! [Pa]
        real(wp), intent(in) :: place, speed           !! of the joint variable [m, m/s]
        real(wp) :: rate(2)                            !! [Pa/s]
        real(wp) :: swept(2), past_piston

        swept = direction(cylinder)*speed*[cylinder%area(1), -cylinder%area(2)]
        if (cylinder%has_gas) then
            rate = cylinder%exponent/chamber_volumes(cylinder, place)*(reference*flow - (atmosphere + pressure)*swept)
            return
        end if
        past_piston = cylinder%leakage*(pressure(1) - pressure(2))
        rate = modulus(cylinder, pressure)/chamber_volumes(cylinder, place)*(flow + [-past_piston, past_piston] - swept)
    end function pressure_rates

    !> Bulk modulus of gas, or of oil with its air, at a pressure.
    elemental real(wp) function modulus(cylinder, pressure)
        type(cylinder_spec), intent(in) :: cylinder
        real(wp), intent(in) :: pressure               !! [Pa]
        real(wp) :: oil, air

        modulus = cylinder%bulk_modulus
        if (cylinder%has_gas) modulus = cylinder%exponent*(atmosphere + pressure)
        if (.not. cylinder%air > 0) return
        oil = (1 - cylinder%air)*exp(-pressure/cylinder%bulk_modulus)
        air = cylinder%air*(atmosphere/(atmosphere + pressure))**(1/adiabatic)
        modulus = (oil + air)/(oil/cylinder%bulk_modulus + air/(adiabatic*(atmosphere + pressure)))
    end function modulus

    !> Pressures by which a cylinder gives a force while its valve is shut: as far above the tank's on one side as below the
    !> supply's on the other. A valve that leaks alike over its edges leads there.
    pure function holding_pressures(cylinder, force) result(pressure)
        type(cylinder_spec), intent(in) :: cylinder
        real(wp), intent(in) :: force                  !! up along the joint variable [N]
        real(wp) :: pressure(2)                        !! [Pa]

        associate (both => cylinder%supply + cylinder%tank)
            pressure(2) = (cylinder%area(1)*both - direction(cylinder)*force)/sum(cylinder%area)
            pressure(1) = both - pressure(2)
        end associate
    end function holding_pressures

    !> Force over way, with the valve shut.
    pure real(wp) function oil_stiffness(cylinder, pressure, place) result(stiffness)
        type(cylinder_spec), intent(in) :: cylinder
        real(wp), intent(in) :: pressure(2)            !! [Pa]
        real(wp), intent(in) :: place                  !! of the joint variable [m]

        stiffness = sum(modulus(cylinder, pressure)*cylinder%area**2/chamber_volumes(cylinder, place))
    end function oil_stiffness

    !> Has the piston not gone through an end of the cylinder? Stops there let it get a little beyond, by errors of steps.
    pure logical function is_within_stroke(cylinder, place) result(is)
        type(cylinder_spec), intent(in) :: cylinder
        real(wp), intent(in) :: place                  !! of the joint variable [m]
        real(wp), parameter :: slack = 1.0e-3_wp       !! part of the stroke

        associate (ends => cylinder%stroke, give => slack*abs(cylinder%stroke(2) - cylinder%stroke(1)))
            is = place >= minval(ends) - give .and. place <= maxval(ends) + give .and. all(chamber_volumes(cylinder, place) > 0)
        end associate
    end function is_within_stroke

    !> Is the oil of each chamber pressed, not torn?
    pure logical function is_pressed(pressure) result(is)
        real(wp), intent(in) :: pressure(2)            !! [Pa]

        is = all(pressure > -atmosphere)
    end function is_pressed
end module linkdyn_cylinder_laws
