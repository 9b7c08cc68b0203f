"""From photographs of cloth on cylinders to the threads of it. [Bisker2011] section 5.4"""
